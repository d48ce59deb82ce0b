"""Damped least squares inverse kinematics: no data but the mean pose (Wampler 1986; Nakamura and Hanafusa 1986)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reconstruction.database import MotionDatabase
from reconstruction.map_problem import GaussianPrior
from reconstruction.prediction import Prediction, SolvedPose


class DampedIkPredictor:
    """Each angle stays near where it was, and is drawn gently to the database's mean pose."""

    STEP = 0.10
    """Radians (metres for the root) a frame: the damping."""
    POSTURE = 0.7
    """Radians from the mean pose."""
    UPRIGHT = 0.15
    """Radians and metres of the root's tilt and height from the mean's: it has no tracker of its own in small sets."""

    def __init__(self, database: MotionDatabase, scale: float, roles: Sequence[str]):
        """Takes of the database the mean root height alone: angles are about their means already."""
        posture = np.full(database.space.dof, self.POSTURE**-2)
        posture[[0, 2, 4]] = 0.0  # where on the floor and which way it faces is nobody's posture
        posture[[1, 3, 5]] = self.UPRIGHT**-2
        self._mean = np.zeros(database.space.dof)
        self._mean[1] = scale * float(np.mean(database.poses[:: max(1, len(database) // 1000), 1]))
        self._posture = posture
        self._precision = np.diag(posture + self.STEP**-2)

    def predict(self, past: Sequence[SolvedPose], trackers: NDArray[np.float64]) -> Prediction:
        """See `Predictor`; the trackers come in with the likelihood."""
        pulled = (self._posture * self._mean + self.STEP**-2 * past[-1].q) / self._precision.diagonal()
        return Prediction(GaussianPrior(pulled, self._precision), np.zeros(0, np.int64), 1.0)
