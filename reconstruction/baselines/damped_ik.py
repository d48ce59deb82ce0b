"""Damped least squares inverse kinematics: Wampler 1986; Nakamura and Hanafusa 1986. It knows a mean and a spread."""

from collections.abc import Sequence

import numpy as np

from reconstruction.database import MotionDatabase
from reconstruction.map_problem import GaussianPrior
from reconstruction.prediction import Observation, Prediction, SolvedPose

_ON_THE_FLOOR = [0, 2, 4]
"""Places in q of the root's x, z and yaw: where on the floor and which way, no part of the posture."""


class DampedIkPredictor:
    """Each coordinate stays near where it was, and is drawn to the database's mean by its spread there."""

    STEP = 0.05
    """Radians (metres for the root) a frame: the damping."""
    SPREADS = 1.0
    """Standard deviations of the database in one of the prior."""
    LEAST_SPREAD = 0.01
    """Radians: of a coordinate that hardly moves in the database."""

    def __init__(self, database: MotionDatabase, scale: float, roles: Sequence[str]):
        """scale: the performer's size over the database's; roles: the trackers there are, which it does not need."""
        poses = np.asarray(database.poses[:: max(1, len(database) // 5000)], np.float64)
        self._mean = poses.mean(axis=0)
        self._mean[1] *= scale
        self._posture = (self.SPREADS * np.maximum(poses.std(axis=0), self.LEAST_SPREAD)) ** -2
        self._posture[_ON_THE_FLOOR] = 0.0
        self._precision = np.diag(self._posture + self.STEP**-2)

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        """See `Predictor`; the trackers come in with the likelihood."""
        pulled = (self._posture * self._mean + self.STEP**-2 * past[-1].q) / self._precision.diagonal()
        return Prediction(GaussianPrior(pulled, self._precision), np.zeros(0, np.int64), 1.0)
