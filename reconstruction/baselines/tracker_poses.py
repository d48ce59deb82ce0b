"""The simple rivals: poses looked up by the trackers alone, as they are or as the start of inverse kinematics."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from devices.sample import ROLES
from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.database import MotionDatabase
from reconstruction.gathering import gather
from reconstruction.map_problem import GaussianPrior
from reconstruction.prediction import Observation, Prediction, SolvedPose
from reconstruction.window_features import seen_from

_AS_IT_IS = 1e-5
"""Radians and metres: a prior so sure of itself that the solver leaves the pose alone."""


class TrackerPosePredictor:
    """The mean of the poses whose tracked joints are nearest, moved onto the trackers; no memory but the facing."""

    def __init__(
        self, database: MotionDatabase, scale: float, roles: Sequence[str], count: int = 1, deviation: float = _AS_IT_IS
    ):
        """scale: the performer's size over the database's; roles: those looked up; count: of poses to average.

        deviation: radians that inverse kinematics may move each angle from what was found, 1e-5 for not at all.
        """
        self._count, self._deviation, self._scale = count, deviation, scale
        self._rows = np.asarray(database.windows).astype(np.int64)
        self._poses, self._headings = np.asarray(database.poses), np.asarray(database.headings)
        self._columns = [ROLES.index(role) for role in roles]
        tracks = np.asarray(database.tracks)[self._rows][:, self._columns]
        seen = seen_from(tracks, self._headings[self._rows], self._headings[self._rows - 1])
        self._tree = cKDTree(seen.reshape(len(seen), -1).astype(np.float32))
        self._body = Body.of(database.space)
        self._state = BodyState.of(len(database.space.skeleton))
        self._joints = [database.space.skeleton.role_joint(role) for role in roles]

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        """See `Predictor`."""
        wanted = seen.trackers[self._columns] / self._scale
        distances, numbers = self._tree.query(wanted.ravel(), self._count)
        rows = self._rows[np.atleast_1d(numbers)]
        mean = gather(rows, 0, self._poses, self._headings).mean(axis=0)
        place(self._body, mean, self._state)
        mean[:3] += (wanted - self._state.position[self._joints]).mean(axis=0)
        mean[:3] *= self._scale
        precision = np.full(len(mean), self._deviation**-2)
        return Prediction(GaussianPrior(mean, np.diag(precision)), rows, float(np.atleast_1d(distances)[0]))
