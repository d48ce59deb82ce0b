"""How all poses of a database are spread: what is said of a pose of which nothing else is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.frame import frozen
from reconstruction.database import MotionDatabase
from reconstruction.gathering import gather

_GROUND = slice(0, 3)
"""Where the root stands says nothing of how likely a pose is."""


@dataclass(frozen=True, eq=False)
class PoseStatistics:
    """One Gaussian for all poses.

    mean: (D,); covariance: (D, D), of poses seen from the heading frames of the poses before them;
    precision: (D, D), its inverse where the root's position is left out (zeros there) and each angle may differ by
    `FLOOR` more.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    precision: NDArray[np.float64]

    FLOOR = 0.03
    """Radians."""
    SAMPLE = 4000
    """Most poses that are looked at, evenly spread."""

    @classmethod
    def of(cls, poses: NDArray[np.float64]) -> "PoseStatistics":
        """The statistics of poses (n, D)."""
        covariance = np.cov(poses, rowvar=False, bias=True)
        angles = slice(_GROUND.stop, None)
        precision = np.zeros_like(covariance)
        free = covariance[angles, angles]
        precision[angles, angles] = np.linalg.inv(free + cls.FLOOR**2 * np.eye(len(free)))
        return cls(frozen(poses.mean(axis=0)), frozen(covariance), frozen(precision))

    @classmethod
    def of_database(cls, database: MotionDatabase, scale: float) -> "PoseStatistics":
        """Those of a database's poses, on a body `scale` times the size of the database's."""
        rows = np.asarray(database.windows[:: max(1, len(database.windows) // cls.SAMPLE)], np.int64)
        poses = gather(rows, 0, np.asarray(database.poses), np.asarray(database.headings))
        poses[:, _GROUND] *= scale
        return cls.of(poses)

    def implausibility(self, q: NDArray[np.float64]) -> float:
        """Half the squared Mahalanobis distance of a pose (D,), but for where the root is: about half the number of
        angles for a pose such as there are, and many times that for a body twisted as none is."""
        off = q - self.mean
        return float(0.5 * off @ self.precision @ off)
