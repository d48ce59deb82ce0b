"""What the paper compares windows by, its Q_{t,m}, and the searches for the nearest of them.

Histories are compared in their first principal components, which hold nearly all of their variance. The neighbour
graph over them is a part of a database that is made on demand (`sixpoint database build --neighbour-graph`); where
there is none, a k-d tree finds the nearest.
"""

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from devices.errors import FileError
from devices.progress import Progress, no_progress
from reconstruction.database import MotionDatabase
from reconstruction.gathering import gather
from reconstruction.neighbour_graph import NeighbourGraph
from reconstruction.prediction import SolvedPose
from reconstruction.window_features import SPAN

FOLDER = "neighbour_graph"
_ARRAYS = ("mean", "basis", "vectors", "links")


@dataclass(frozen=True, eq=False)
class HistorySpace:
    """mean: (m D,); basis: (m D, C): the principal components of a database's histories."""

    mean: NDArray[np.float64]
    basis: NDArray[np.float64]

    COMPONENTS = 32
    SAMPLE = 20_000

    @classmethod
    def fitted(cls, database: MotionDatabase) -> "HistorySpace":
        """To every so many-th window of a database."""
        sample = histories(database, database.windows[:: max(1, len(database.windows) // cls.SAMPLE)])
        centred = sample - sample.mean(axis=0)
        vectors = np.linalg.eigh(centred.T @ centred)[1]
        return cls(sample.mean(axis=0), np.ascontiguousarray(vectors[:, ::-1][:, : cls.COMPONENTS]))

    def projected(self, found: NDArray[np.float64]) -> NDArray[np.float32]:
        """(..., C) of histories (..., m D)."""
        return ((found - self.mean) @ self.basis).astype(np.float32)

    def vectors(self, database: MotionDatabase) -> NDArray[np.float32]:
        """(W, C) of all windows of a database."""
        parts = np.array_split(database.windows, max(1, len(database.windows) // 8192))
        return np.concatenate([self.projected(histories(database, rows)) for rows in parts])


def histories(database: MotionDatabase, rows: NDArray[np.integer]) -> NDArray[np.float64]:
    """Q_{t,m} (n, m D) of the windows that end before rows (n,), seen from the heading frames before them."""
    poses, headings = np.asarray(database.poses), np.asarray(database.headings)
    rows = np.asarray(rows, np.int64)
    return np.concatenate([gather(rows, back, poses, headings) for back in range(1, SPAN + 1)], axis=1)


class HistorySearch(Protocol):
    """Finds the windows whose histories are nearest."""

    @property
    def space(self) -> HistorySpace:
        """What they are compared in."""
        ...

    def nearest(
        self, query: NDArray[np.float32], past: Sequence[SolvedPose], count: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Numbers (k,) and distances (k,) of windows near to a projected history (C,), nearest first; k <= count.

        past: the solved poses that it is of, by which a search knows whether it goes on from its last frame.
        """
        ...


class TreeSearch:
    """The exact nearest, by a k-d tree that is made here: seconds for a million windows."""

    def __init__(self, database: MotionDatabase):
        self.space = HistorySpace.fitted(database)
        self._tree = cKDTree(self.space.vectors(database))

    def nearest(
        self, query: NDArray[np.float32], past: Sequence[SolvedPose], count: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """See `HistorySearch`."""
        distances, numbers = self._tree.query(query, min(count, self._tree.n))
        return np.atleast_1d(numbers), np.atleast_1d(distances)


class GraphSearch:
    """The nearest along a neighbour graph, from the last frame's neighbours on."""

    def __init__(self, space: HistorySpace, graph: NeighbourGraph):
        self.space, self.graph = space, graph
        self._near = np.zeros(0, np.int64)
        self._last: SolvedPose | None = None

    def nearest(
        self, query: NDArray[np.float32], past: Sequence[SolvedPose], count: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """See `HistorySearch`."""
        goes_on = self._last is not None and len(past) > 1 and past[-2] is self._last
        if goes_on:
            following = self.graph.links[self._near, 1].astype(np.int64)
            begin = np.concatenate((following[following >= 0], self._near))
            found = self.graph.nearest(query, begin, count)
        else:
            found = self.graph.begun(query, count)
        self._near, self._last = found[0], past[-1]
        return found


def history_search(database: MotionDatabase) -> HistorySearch:
    """Along the graph that was made with the database, exact where there is none. Raises FileError where the graph is
    broken."""
    folder = database.path / FOLDER
    if not folder.is_dir():
        return TreeSearch(database)
    try:
        mean, basis, vectors, links = (np.load(folder / f"{name}.npy", mmap_mode="r") for name in _ARRAYS)
    except (OSError, ValueError):
        raise FileError(f"{folder}: missing or cut off; build the database again") from None
    if not len(vectors) == len(links) == len(database.windows):
        raise FileError(f"{folder}: not this database's graph; build the database again")
    graph = NeighbourGraph(np.array(vectors), np.array(links))
    return GraphSearch(HistorySpace(np.array(mean), np.array(basis)), graph)


def add_neighbour_graph(database: MotionDatabase, progress: Progress = no_progress) -> None:
    """Makes the neighbour graph of a database, in its folder; minutes for a million windows."""
    search = graph_search(database, progress)
    beside = Path(tempfile.mkdtemp(prefix=f".{FOLDER}.", dir=database.path))
    try:
        arrays = (search.space.mean, search.space.basis, search.graph.vectors, search.graph.links)
        for name, array in zip(_ARRAYS, arrays, strict=True):
            np.save(beside / f"{name}.npy", array)
        shutil.rmtree(database.path / FOLDER, ignore_errors=True)
        beside.chmod(0o755)
        beside.rename(database.path / FOLDER)
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise


def graph_search(database: MotionDatabase, progress: Progress = no_progress) -> GraphSearch:
    """A search along a graph that is made here and kept nowhere."""
    space = HistorySpace.fitted(database)
    return GraphSearch(space, NeighbourGraph.built(space.vectors(database), np.asarray(database.windows), progress))
