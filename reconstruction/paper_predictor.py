"""The paper's prior to the letter: neighbours by joint-angle history alone, and its one-direction regression."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reconstruction.database import MotionDatabase
from reconstruction.gathering import gather, see_from
from reconstruction.local_regression import history_weights, regress
from reconstruction.map_problem import GaussianPrior
from reconstruction.paper_histories import HistorySearch, histories, history_search
from reconstruction.prediction import Observation, Prediction, SolvedPose


class PaperPredictor:
    """Eq. 3-10 on the K windows whose histories Q_{t,m} are nearest."""

    NEIGHBOURS = 48
    LEAST_DEVIATION = 1e-3
    """Radians: sigma_d where all neighbours agree."""

    def __init__(self, database: MotionDatabase, scale: float, search: HistorySearch | None = None):
        """scale: the performer's size over the database's. search: for the neighbours; the database's own where None,
        which is the paper's neighbour graph if it was built with one."""
        self._scale = scale
        self._database = database
        self._poses, self._headings = np.asarray(database.poses), np.asarray(database.headings)
        self._windows = np.asarray(database.windows).astype(np.int64)
        self.search = search or history_search(database)
        self._spacing = self._typical_distance()

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        """See `Predictor`; the trackers are not looked at."""
        query = self._query(past)
        numbers, distances = self.search.nearest(self.search.space.projected(query), past, self.NEIGHBOURS)
        rows = self._windows[numbers]
        near = histories(self._database, rows)
        found = regress(near, gather(rows, 0, self._poses, self._headings), history_weights(near, query), query)
        deviation = np.maximum(found.deviation, self.LEAST_DEVIATION)
        mean = found.mean.copy()
        mean[:3] *= self._scale
        coverage = float(distances[0] / self._spacing)
        return Prediction(GaussianPrior(mean, np.diag(deviation**-2)), rows, coverage)

    def _typical_distance(self) -> float:
        """Median distance between the histories of windows that follow each other."""
        before = np.flatnonzero(np.diff(self._windows) == 1)[:: max(1, len(self._windows) // 200)]
        one, next_one = (
            self.search.space.projected(histories(self._database, self._windows[at])) for at in (before, before + 1)
        )
        return max(float(np.median(np.linalg.norm(next_one - one, axis=1))), 1e-6) if len(before) else 1e-6

    def _query(self, past: Sequence[SolvedPose]) -> NDArray[np.float64]:
        """Q_{t,m} (m D,) of the solved past, at the database's size."""
        here = past[-1].heading
        seen = []
        for pose in reversed(past):
            q = pose.q.copy()
            see_from(q, pose.heading, here)
            q[:3] /= self._scale
            seen.append(q)
        return np.concatenate(seen)
