"""The nearest poses of the database around the performer: what the solver's prior is made of, to look at."""

import numpy as np
from numpy.typing import NDArray

from devices.frame import frozen
from reconstruction.body_kinematics import Body, joint_positions
from reconstruction.database import MotionDatabase
from reconstruction.gathering import gather
from reconstruction.motion_operations import leg_length
from reconstruction.skeleton import Skeleton
from reconstruction.window_features import seen_from

MOST = 12
"""So many are shown: more hide each other."""


class Ghosts:
    """Stands database poses where the solver used them, on the performer's body."""

    def __init__(self, database: MotionDatabase, skeleton: Skeleton) -> None:
        self._poses, self._headings = np.asarray(database.poses), np.asarray(database.headings)
        self._body = Body.of(database.space.with_skeleton(skeleton))
        self._scale = leg_length(skeleton) / leg_length(database.space.skeleton)

    def joints(self, neighbours: NDArray[np.integer], heading: NDArray[np.float64]) -> NDArray[np.float64]:
        """(K, J, 3) metres, world, of the nearest `MOST` at most. neighbours, heading: as in `Solution`."""
        rows = np.asarray(neighbours[:MOST], np.int64)
        q = gather(rows, 0, self._poses, self._headings)
        q[:, :3] *= self._scale
        own = np.broadcast_to(heading, (len(rows), 3))
        return frozen(seen_from(joint_positions(self._body, q), own, np.zeros((len(rows), 3))))
