"""Local PCR: Liu et al., "Realtime Human Motion Control with a Small Number of Inertial Sensors", I3D 2011.

An online local dynamic model: q_t is regressed on the principal components of the K nearest histories Q_{t,m}, with a
Gaussian error whose spread is what the regression leaves over (their section 5).
"""

from collections.abc import Sequence

import numpy as np
from sklearn.decomposition import PCA

from reconstruction.baselines.neighbourhood import NeighbourhoodFinder, own_history
from reconstruction.database import MotionDatabase
from reconstruction.map_problem import GaussianPrior
from reconstruction.prediction import Observation, Prediction, SolvedPose


class LocalPcrPredictor:
    """A diagonal Gaussian about the principal component regression of the next pose."""

    VARIANCE_KEPT = 0.95
    """Share of the histories' variance that the components hold."""
    SHRINKAGE = 0.02
    """Ridge on the component scores, as a share of the largest variance: the smallest components do not extrapolate."""
    LEAST_DEVIATION = 0.01
    """Radians (metres for the root): the deviation where all neighbours agree."""

    def __init__(self, database: MotionDatabase, scale: float, roles: Sequence[str]):
        """scale: the performer's size over the database's; roles: the trackers there are, which it does not need."""
        self._finder = NeighbourhoodFinder(database, scale)

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        """See `Predictor`."""
        near = self._finder.find(past, seen.trackers)
        components = PCA(self.VARIANCE_KEPT, svd_solver="full").fit(near.histories)
        scores = components.transform(near.histories)
        query = components.transform(own_history(past)[None])[0]
        mean_x, mean_y = near.weights @ scores, near.weights @ near.following
        x, y = scores - mean_x, near.following - mean_y
        scatter = x.T @ (near.weights[:, None] * x)
        scatter += self.SHRINKAGE * max(scatter.diagonal().max(), 1e-12) * np.eye(len(scatter))
        slope = np.linalg.solve(scatter, x.T @ (near.weights[:, None] * y))
        deviation = np.sqrt(near.weights @ (y - x @ slope) ** 2 + self.LEAST_DEVIATION**2)
        mean = mean_y + (query - mean_x) @ slope
        return Prediction(GaussianPrior(mean, np.diag(deviation**-2)), near.rows, near.coverage)
