"""The paper's prior to the letter: neighbours by joint-angle history alone, and its one-direction regression."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from reconstruction.database import MotionDatabase
from reconstruction.local_model import gather, see_from
from reconstruction.local_regression import history_weights, regress
from reconstruction.map_problem import GaussianPrior
from reconstruction.prediction import Prediction, SolvedPose
from reconstruction.window_features import SPAN


class PaperPredictor:
    """Eq. 3-10 on the K windows whose histories Q_{t,m} are nearest.

    Histories are compared in their first `COMPONENTS` principal components, which hold nearly all of their variance.
    """

    NEIGHBOURS = 48
    COMPONENTS = 32
    LEAST_DEVIATION = 1e-3
    """Radians: sigma_d where all neighbours agree."""

    def __init__(self, database: MotionDatabase, scale: float):
        """scale: the performer's size over the database's. Builds a tree over all histories: seconds for a million."""
        self._scale = scale
        self._poses, self._headings = np.asarray(database.poses), np.asarray(database.headings)
        self._windows = np.asarray(database.windows).astype(np.int64)
        sample = self._histories(self._windows[:: max(1, len(self._windows) // 20_000)])
        self._mean = sample.mean(axis=0)
        centred = sample - self._mean
        self._basis = np.linalg.eigh(centred.T @ centred)[1][:, ::-1][:, : self.COMPONENTS]
        parts = np.array_split(self._windows, max(1, len(self._windows) // 8192))
        near = np.concatenate([(self._histories(rows) - self._mean) @ self._basis for rows in parts])
        self._tree = cKDTree(near)
        self._spacing = max(float(np.median(self._tree.query(near[:: max(1, len(near) // 200)], 2)[0][:, 1])), 1e-6)

    def predict(self, past: Sequence[SolvedPose], trackers: NDArray[np.float64]) -> Prediction:
        """See `Predictor`; the trackers are not looked at."""
        query = self._query(past)
        count = min(self.NEIGHBOURS, len(self._windows))
        distances, numbers = self._tree.query((query - self._mean) @ self._basis, count)
        rows = self._windows[np.atleast_1d(numbers)]
        histories = self._histories(rows)
        found = regress(
            histories, gather(rows, 0, self._poses, self._headings), history_weights(histories, query), query
        )
        deviation = np.maximum(found.deviation, self.LEAST_DEVIATION)
        mean = found.mean.copy()
        mean[:3] *= self._scale
        coverage = float(np.atleast_1d(distances)[0] / self._spacing)
        return Prediction(GaussianPrior(mean, np.diag(deviation**-2)), rows, coverage)

    def _histories(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Q_{t,m} (n, m D) of the windows that end before rows (n,), seen from the heading frames before them."""
        return np.concatenate([gather(rows, back, self._poses, self._headings) for back in range(1, SPAN + 1)], axis=1)

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
