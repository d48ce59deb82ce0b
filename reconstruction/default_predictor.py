"""Our own prior: neighbours by history and by trackers, as one Gaussian with all their correlations."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.database import MotionDatabase
from reconstruction.gathering import gather
from reconstruction.limb_poses import LimbPoses
from reconstruction.local_model import LocalModelSettings, local_prior
from reconstruction.pose_statistics import PoseStatistics
from reconstruction.prediction import Observation, Prediction, SolvedPose
from reconstruction.thinning import thinned
from reconstruction.tracker_matching import Sighting, TrackerMatcher
from reconstruction.window_features import seen_from


@dataclass(frozen=True)
class NeighbourSettings:
    """How neighbours are chosen and weighed.

    count: K, 8 to 256.
    candidates: windows retrieved before near duplicates are thinned out, at least `count`.
    apart: frames, how far two neighbours of one clip must be from each other, at least 1.
    trusted_until: coverage up to which the neighbours are taken at their word, above 0; beyond it the prior widens in
        proportion (`local_model`).
    way_weight: how much the trackers' root mean square distance over the last half second counts, where there are few
        trackers, against that of the last pose and of the trackers now; 0 or more.
    sharpness: how fast a neighbour's weight falls with its distance over the median distance, above 0.
    """

    count: int = 128
    candidates: int = 384
    apart: int = 2
    way_weight: float = 1.5
    sharpness: float = 10.0
    trusted_until: float = 2.0


class DefaultPredictor:
    """Retrieves by the last poses and these trackers, and hands the neighbours to `local_prior`.

    Beyond the paper: it retrieves by the trackers too; few trackers count by their way, since their place alone does
    not tell a wrong history from a right one; it thins out near duplicates in time; it keeps how degrees of freedom
    vary together; and it trusts the neighbours less the farther they are.
    """

    WIDEST = 10.0
    """Most that the prior widens: beyond, the database has nothing to say."""

    def __init__(
        self, database: MotionDatabase, scale: float, neighbours: NeighbourSettings, local: LocalModelSettings
    ):
        """scale: the performer's size over the database's."""
        self._database, self._scale = database, scale
        self._neighbours, self._local = neighbours, local
        self._matcher = TrackerMatcher(database)
        self._poses, self._headings = np.asarray(database.poses), np.asarray(database.headings)
        self._windows = np.asarray(database.windows)
        self._clips = np.searchsorted(database.firsts, self._windows, side="right")
        self._all_poses = PoseStatistics.of_database(database, scale)
        self._limbs = LimbPoses(database, scale, self._all_poses, local.limbs)

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        """See `Predictor`."""
        s, last = self._neighbours, past[-1]
        numbers, near = self._database.index.nearest(self._feature(past, seen.trackers), s.candidates)
        distances = near
        if seen.way is not None:
            distances = np.sqrt(near**2 + s.way_weight * self._mean_squares(seen.way, numbers))
            order = np.argsort(distances, kind="stable")
            numbers, near, distances = numbers[order], near[order], distances[order]
        rows = self._windows[numbers].astype(np.int64)
        keep = thinned(rows, self._clips[numbers], s.apart, s.count)
        rows, near, distances = rows[keep], np.sort(near[keep]), distances[keep]
        following = self._at_scale(rows, 0)
        steps = following - self._at_scale(rows, 1)
        coverage = float(near[: max(1, len(near) // 8)].mean() / self._database.spacing)
        weights = gaussian_weights(distances, s.sharpness)
        widening = min(max(1.0, coverage / s.trusted_until), self.WIDEST)
        doubt = self._local.doubt(widening)
        limbs = self._limbs.statement(seen, *doubt) if any(doubt) else None
        trackers = int(seen.measured.sum())
        prior = local_prior(
            following, steps, weights, last.q, widening, self._all_poses.covariance, limbs, trackers, self._local
        )
        return Prediction(prior, rows, coverage)

    def _mean_squares(self, way: Sighting, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Metres^2 (K,): how far the windows' tracked joints went from the trackers' way; the median where they have
        no such long past."""
        squares = self._matcher.squares(way, self._windows[numbers].astype(np.int64) - 1, free=False)
        known = np.isfinite(squares)
        typical = np.median(squares[known]) if known.any() else 0.0
        return np.where(known, squares, typical) / max(way.count, 1)

    def _feature(self, past: Sequence[SolvedPose], trackers: NDArray[np.float64]) -> NDArray[np.float32]:
        last, earliest = past[-1], past[0]
        earlier = seen_from(earliest.joints[None], earliest.heading[None], last.heading[None])
        points = (last.joints[None] / self._scale, earlier / self._scale, trackers[None] / self._scale)
        return self._database.features.features(last.q[None, 3:], *points)[0]

    def _at_scale(self, rows: NDArray[np.int64], back: int) -> NDArray[np.float64]:
        """Poses (K, D) of the rows `back` before, seen from the heading frames one row before."""
        q = gather(rows, back, self._poses, self._headings)
        q[:, :3] *= self._scale
        return q


def gaussian_weights(distances: NDArray[np.floating], sharpness: float) -> NDArray[np.float64]:
    """(K,) Gaussian weights (eq. 7) that sum to one; their width is the median distance over sqrt(sharpness)."""
    width = max(float(np.median(distances)), 1e-6)
    weights = np.exp(-0.5 * sharpness * (distances.astype(np.float64) / width) ** 2)
    return weights / weights.sum()
