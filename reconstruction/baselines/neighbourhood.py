"""What the local baselines learn from: the windows nearest to the last movement and the trackers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.database import MotionDatabase
from reconstruction.default_predictor import NeighbourSettings, gaussian_weights
from reconstruction.gathering import gather, see_from
from reconstruction.prediction import SolvedPose
from reconstruction.thinning import thinned
from reconstruction.window_features import SPAN, seen_from


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """K windows, seen from the heading frame of the last solved pose, at the performer's size.

    rows: (K,) database rows; weights: (K,) summing to one; coverage: their distance over the database's own spacing.
    following: (K, D) the poses q_t that came next; histories: (K, m D) the m poses before, latest first.
    """

    rows: NDArray[np.int64]
    weights: NDArray[np.float64]
    coverage: float
    following: NDArray[np.float64]
    histories: NDArray[np.float64]


class NeighbourhoodFinder:
    """Retrieves the same neighbours, with the same weights, as `DefaultPredictor`."""

    def __init__(self, database: MotionDatabase, scale: float, settings: NeighbourSettings | None = None):
        """scale: the performer's size over the database's."""
        self._database, self._scale, self._settings = database, scale, settings or NeighbourSettings()
        self._poses, self._headings = np.asarray(database.poses), np.asarray(database.headings)
        self._windows = np.asarray(database.windows)
        self._clips = np.searchsorted(database.firsts, self._windows, side="right")

    def find(self, past: Sequence[SolvedPose], trackers: NDArray[np.float64]) -> Neighbourhood:
        """The neighbourhood of what a `Predictor` is given: solved poses (oldest first), trackers (6, 3) metres."""
        s, last, earliest = self._settings, past[-1], past[0]
        earlier = seen_from(earliest.joints[None], earliest.heading[None], last.heading[None])
        points = (last.joints[None] / self._scale, earlier / self._scale, trackers[None] / self._scale)
        feature = self._database.features.features(last.q[None, 3:], *points)[0]
        numbers, distances = self._database.index.nearest(feature, s.candidates)
        rows = self._windows[numbers].astype(np.int64)
        keep = thinned(rows, self._clips[numbers], s.apart, s.count)
        rows, distances = rows[keep], distances[keep]
        seen = [self._at_scale(rows, back) for back in range(SPAN + 1)]
        coverage = float(distances[: max(1, len(distances) // 8)].mean() / self._database.spacing)
        weights = gaussian_weights(distances, s.sharpness)
        return Neighbourhood(rows, weights, coverage, seen[0], np.concatenate(seen[1:], axis=1))

    def _at_scale(self, rows: NDArray[np.int64], back: int) -> NDArray[np.float64]:
        q = gather(rows, back, self._poses, self._headings)
        q[:, :3] *= self._scale
        return q


def own_history(past: Sequence[SolvedPose]) -> NDArray[np.float64]:
    """Q_{t,m} (m D,), latest first, seen from the heading frame of the last solved pose."""
    seen = []
    for pose in reversed(past):
        q = pose.q.copy()
        see_from(q, pose.heading, past[-1].heading)
        seen.append(q)
    return np.concatenate(seen)
