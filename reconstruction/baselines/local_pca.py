"""Local PCA: Chai and Hodgins, "Performance Animation from Low-Dimensional Control Signals", SIGGRAPH 2005, section 5.

A linear model q = p + B b of the K nearest examples is built each frame. The pose stays in its subspace, near the mean
(their E_prior, a Mahalanobis distance of b) and near the last two poses' constant velocity (their E_smoothness). Their
subspace is exact; here a pose may leave it by `STRAY`, so that the solver and the likelihood are those of our method.
"""

from collections.abc import Sequence

import numpy as np
from sklearn.decomposition import PCA

from reconstruction.baselines.neighbourhood import NeighbourhoodFinder, own_history
from reconstruction.database import MotionDatabase
from reconstruction.map_problem import GaussianPrior
from reconstruction.prediction import Observation, Prediction, SolvedPose


class LocalPcaPredictor:
    """A Gaussian in the principal subspace of the neighbours."""

    VARIANCE_KEPT = 0.99
    """Share of the examples' variance that the subspace holds (Chai and Hodgins, section 5.2)."""
    STRAY = 0.02
    """Radians (metres for the root) a degree of freedom may leave the subspace."""
    SMOOTH = 0.15
    """Radians (metres) from the pose that a constant velocity would lead to: the weight of E_smoothness."""

    def __init__(self, database: MotionDatabase, scale: float, roles: Sequence[str]):
        """scale: the performer's size over the database's; roles: the trackers there are, which it does not need."""
        self._finder = NeighbourhoodFinder(database, scale)

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        """See `Predictor`."""
        near = self._finder.find(past, seen.trackers)
        subspace = PCA(self.VARIANCE_KEPT, svd_solver="full").fit(near.following)
        mean, basis, variance = (
            np.asarray(x, np.float64) for x in (subspace.mean_, subspace.components_, subspace.explained_variance_)
        )
        inside = 1 / (variance + self.STRAY**2) - self.STRAY**-2
        dof = len(mean)
        precision = self.STRAY**-2 * np.eye(dof) + (basis.T * inside) @ basis
        both = precision + self.SMOOTH**-2 * np.eye(dof)
        history = own_history(past)
        steady = 2 * history[:dof] - history[dof : 2 * dof]
        centre = np.linalg.solve(both, precision @ mean + self.SMOOTH**-2 * steady)
        return Prediction(GaussianPrior(np.asarray(centre, np.float64), both), near.rows, near.coverage)
