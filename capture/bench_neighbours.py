"""The searches for neighbours: how long they take, and which share of the true neighbours they find."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from capture.latency import percentiles_ms
from devices.frame import TrackerFrame
from reconstruction.database import MotionDatabase
from reconstruction.neighbours import NeighbourIndex
from reconstruction.paper_histories import (
    GraphSearch,
    HistorySearch,
    HistorySpace,
    TreeSearch,
    graph_search,
    history_search,
)
from reconstruction.paper_predictor import PaperPredictor
from reconstruction.prediction import SolvedPose
from reconstruction.solver import Reconstructor

Result = TypeVar("Result")

PLAIN_RECALL = 48
"""The paper's number of neighbours: what recall is told for, whatever a method asks for."""


@dataclass(frozen=True, eq=False)
class _Listening:
    """An index that notes what it is asked."""

    index: NeighbourIndex
    asked: list[tuple[NDArray[np.float32], int]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.index)

    def nearest(self, feature: NDArray[np.float32], count: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        self.asked.append((feature.copy(), count))
        return self.index.nearest(feature, count)


def neighbour_figures(database: MotionDatabase, takes: list[list[TrackerFrame]], queries: int) -> dict:
    """Milliseconds of the searches that our own method makes while it solves takes, their recall against an exact
    scan, and that scan's milliseconds."""
    listening = _Listening(database.index)
    solver = Reconstructor(replace(database, index=listening))  # type: ignore[arg-type]
    for take in takes:
        solver.solve_take(take)
    stored = database.index.vectors()
    sizes = np.einsum("nf,nf->n", stored, stored)
    ours, scans, recalled = _Times(), _Times(), []
    asked = listening.asked[:: max(1, len(listening.asked) // queries)]
    for query, count in asked:
        found = ours.of(lambda query=query, count=count: database.index.nearest(query, count))[1]
        exact = scans.of(lambda query=query, count=count: _scan(stored, sizes, query, count))
        recalled.append([_recall(found, exact, PLAIN_RECALL), _recall(found, exact, count)])
    of_few, of_all = np.mean(recalled, axis=0)
    return {
        "search_ms": ours.percentiles(),
        "exact_scan_ms": scans.percentiles(),
        f"recall_at_{PLAIN_RECALL}": round(float(of_few), 4),
        f"recall_at_{asked[0][1]}": round(float(of_all), 4),
    }


def _scan(
    stored: NDArray[np.float32], sizes: NDArray[np.float32], query: NDArray[np.float32], count: int
) -> NDArray[np.floating]:
    """Distances of the nearest `count` stored vectors (n, F), nearest first; sizes: (n,) their squared lengths."""
    rough = sizes - 2 * stored @ query
    near = np.argpartition(rough, min(2 * count, len(stored) - 1))[: 2 * count]
    return np.sort(np.linalg.norm(stored[near] - query, axis=1))[:count]


def _recall(found: NDArray[np.floating], exact: NDArray[np.floating], count: int) -> float:
    """Share of the nearest `count` that was found, by distance: windows that are equal are equally right."""
    exact = exact[:count]
    return float(np.sum(found[:count] <= exact[-1] * (1 + 1e-4) + 1e-6) / len(exact))


class _Times:
    """Milliseconds of calls."""

    def __init__(self) -> None:
        self._milliseconds: list[float] = []

    def of(self, call: Callable[[], Result]) -> Result:
        """Makes the call, and notes its time."""
        began = time.perf_counter_ns()
        result = call()
        self._milliseconds.append((time.perf_counter_ns() - began) * 1e-6)
        return result

    def percentiles(self) -> dict[str, float]:
        """See `percentiles_ms`."""
        return percentiles_ms(np.array(self._milliseconds))


@dataclass(frozen=True, eq=False)
class _ListeningSearch:
    """A search for the paper's method that notes what it is asked."""

    search: HistorySearch
    asked: list[tuple[NDArray[np.float32], tuple[SolvedPose, ...]]] = field(default_factory=list)

    @property
    def space(self) -> HistorySpace:
        return self.search.space

    def nearest(
        self, query: NDArray[np.float32], past: Sequence[SolvedPose], count: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        self.asked.append((query.copy(), tuple(past)))
        return self.search.nearest(query, past, count)


def history_figures(database: MotionDatabase, takes: list[list[TrackerFrame]], queries: int) -> dict:
    """Milliseconds and recall of the paper's neighbour graph, and of our kind of index, on the searches that the
    paper's method makes, beside a k-d tree's. The graph is made here where the database has none."""
    listening = _ListeningSearch(TreeSearch(database))
    solver = Reconstructor(database, predictor=PaperPredictor(database, 1.0, listening))
    for take in takes:
        solver.solve_take(take)
    began = time.perf_counter()
    graph = history_search(database)
    if not isinstance(graph, GraphSearch):
        graph = graph_search(database)
    ready = time.perf_counter() - began
    vectors = graph.graph.vectors
    index = NeighbourIndex.trained(vectors, len(vectors))
    index.add(vectors)
    count = PaperPredictor.NEIGHBOURS
    tree, walk, lists, recalled = _Times(), _Times(), _Times(), []
    for query, past in listening.asked[-queries:]:
        exact = tree.of(lambda query=query, past=past: listening.search.nearest(query, past, count))[1]
        walked = walk.of(lambda query=query, past=past: graph.nearest(query, past, count))[1]
        found = lists.of(lambda query=query: index.nearest(query, count))[1]
        recalled.append([_recall(walked, exact, count), _recall(found, exact, count)])
    of_walk, of_lists = np.mean(recalled, axis=0)
    return {
        "tree_ms": tree.percentiles(),
        "graph_ms": walk.percentiles(),
        "index_ms": lists.percentiles(),
        "graph_recall_at_48": round(float(of_walk), 4),
        "index_recall_at_48": round(float(of_lists), 4),
        "graph_ready_s": round(ready, 2),
    }
