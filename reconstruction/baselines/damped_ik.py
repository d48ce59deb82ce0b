"""Damped least squares inverse kinematics: no data but the mean pose (Wampler 1986; Nakamura and Hanafusa 1986)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reconstruction.database import MotionDatabase
from reconstruction.map_problem import GaussianPrior
from reconstruction.pose_space import ROOT_DOF
from reconstruction.prediction import Prediction, SolvedPose


class DampedIkPredictor:
    """Each angle stays near where it was, and is drawn gently to the database's mean pose."""

    STEP = 0.10
    """Radians (metres for the root) a frame: the damping."""
    POSTURE = 0.7
    """Radians from the mean pose."""

    def __init__(self, database: MotionDatabase, scale: float, roles: Sequence[str]):
        """Takes of the database its degrees of freedom alone: angles are about their means already."""
        precision = np.full(database.space.dof, self.STEP**-2)
        precision[ROOT_DOF:] += self.POSTURE**-2
        self._precision = np.diag(precision)
        self._kept = self.STEP**-2 / precision

    def predict(self, past: Sequence[SolvedPose], trackers: NDArray[np.float64]) -> Prediction:
        """See `Predictor`; the trackers come in with the likelihood."""
        return Prediction(GaussianPrior(self._kept * past[-1].q, self._precision), np.zeros(0, np.int64), 1.0)
