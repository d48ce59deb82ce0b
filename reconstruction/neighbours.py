"""Nearest neighbours among a million windows: the one file that knows faiss.

An inverted file (Sivic and Zisserman 2003; faiss's IVF): k-means parts the vectors into lists of about `LIST_LENGTH`,
and a search looks through the `LISTS_SEARCHED` lists whose centres are nearest. What it costs hardly grows with the
database. A navigable small-world graph was measured too (faiss's HNSW): windows a frame apart are near duplicates, its
links stay among them, and whole clips cannot be reached, for as much time. The walk along a graph that the paper takes
is in `neighbour_graph`.
"""

import os
from pathlib import Path
from typing import Any

import faiss
import numpy as np
from numpy.typing import NDArray

LIST_LENGTH = 512
LISTS_SEARCHED = 24
TRAINED_ON = 64
"""Vectors that the place of one list's centre is found from."""


class NeighbourIndex:
    """An index over feature vectors (n, F), numbered in the order in which they were added."""

    def __init__(self, index: Any):
        self._index = index
        self._index.nprobe = min(LISTS_SEARCHED, index.nlist)

    def __len__(self) -> int:
        return self._index.ntotal

    @classmethod
    def trained(cls, sample: NDArray[np.float32], count: int) -> "NeighbourIndex":
        """An index to be filled, with `add`, with `count` vectors such as the sample (m, F); see `sample_size`."""
        faiss.omp_set_num_threads(os.cpu_count() or 1)
        dimensions = sample.shape[1]
        index = faiss.IndexIVFFlat(faiss.IndexFlatL2(dimensions), dimensions, _lists(count))
        index.train(np.ascontiguousarray(sample, np.float32))
        return cls(index)

    @staticmethod
    def sample_size(count: int) -> int:
        """How many vectors `trained` wants to see of `count`."""
        return min(count, TRAINED_ON * _lists(count))

    def add(self, features: NDArray[np.float32]) -> None:
        """Adds vectors (n, F)."""
        self._index.add(np.ascontiguousarray(features, np.float32))

    def nearest(self, feature: NDArray[np.float32], count: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Numbers (k,) and distances (k,) of the nearest vectors to one (F,), nearest first; k <= count."""
        squares, numbers = self._index.search(feature[None], min(count, len(self)))
        found = numbers[0] >= 0
        return numbers[0][found], np.sqrt(np.maximum(squares[0][found], 0))

    def near_to_all(self, features: NDArray[np.float32], count: int) -> NDArray[np.int64]:
        """Numbers (n, count) of windows near to each of many (n, F), by all processors, in a quarter of the time and
        not quite the nearest; -1 where there are fewer."""
        lists = faiss.SearchParametersIVF(nprobe=max(1, self._index.nprobe // 4))  # type: ignore[call-arg]
        return self._index.search(np.ascontiguousarray(features, np.float32), count, params=lists)[1]

    def vectors(self) -> NDArray[np.float32]:
        """All vectors (n, F), in order: a copy."""
        self._index.make_direct_map()
        return self._index.reconstruct_n(0, len(self))

    def write(self, path: Path) -> None:
        """Writes the index to a file."""
        faiss.write_index(self._index, str(path))

    @classmethod
    def read(cls, path: Path) -> "NeighbourIndex":
        """Reads what `write` wrote. Raises RuntimeError where the file is broken."""
        return cls(faiss.read_index(str(path)))


def _lists(count: int) -> int:
    return max(1, count // LIST_LENGTH)
