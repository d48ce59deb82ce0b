"""Nearest neighbours among a million windows: the one file that knows faiss.

A hierarchical navigable small world graph (Malkov and Yashunin 2018) stands in for the neighbour graph of Chai and
Hodgins (2005) that the paper searches: the same walk from near pose to nearer pose, with long links added.
"""

import os
from pathlib import Path
from typing import Any

import faiss
import numpy as np
from numpy.typing import NDArray

LINKS = 32
BUILD_BREADTH = 80
SEARCH_BREADTH = 160


class NeighbourIndex:
    """An index over feature vectors (n, F)."""

    def __init__(self, index: Any):
        self._index = index
        self._index.hnsw.efSearch = SEARCH_BREADTH

    def __len__(self) -> int:
        return self._index.ntotal

    @classmethod
    def empty(cls, dimensions: int) -> "NeighbourIndex":
        """An index to be filled with `add`, by all processors."""
        faiss.omp_set_num_threads(os.cpu_count() or 1)
        index = faiss.IndexHNSWFlat(dimensions, LINKS)
        index.hnsw.efConstruction = BUILD_BREADTH
        return cls(index)

    def add(self, features: NDArray[np.float32]) -> None:
        """Adds vectors (n, F); they are numbered in order."""
        self._index.add(np.ascontiguousarray(features, np.float32))

    def nearest(self, feature: NDArray[np.float32], count: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Numbers (k,) and distances (k,) of the nearest vectors to one (F,), nearest first; k <= count."""
        squares, numbers = self._index.search(feature[None], min(count, len(self)))
        found = numbers[0] >= 0
        return numbers[0][found], np.sqrt(np.maximum(squares[0][found], 0))

    def vectors(self) -> NDArray[np.float32]:
        """All vectors (n, F), in order: a copy."""
        return self._index.reconstruct_n(0, len(self))

    def write(self, path: Path) -> None:
        """Writes the index to a file."""
        faiss.write_index(self._index, str(path))

    @classmethod
    def read(cls, path: Path) -> "NeighbourIndex":
        """Reads what `write` wrote. Raises RuntimeError where the file is broken."""
        return cls(faiss.read_index(str(path)))
