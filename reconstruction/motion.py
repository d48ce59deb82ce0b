"""Poses and motions: a skeleton's local rotations over time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.skeleton import Skeleton


@dataclass(frozen=True, eq=False, slots=True)
class Pose:
    """One moment of a skeleton.

    time_s: seconds from the start of its take or session.
    root_position: (3,) metres, world.
    rotations: (J, 4) unit quaternions (x, y, z, w), `R_parent_joint`; the root's is `R_world_root`.
    """

    time_s: float
    root_position: NDArray[np.float64]
    rotations: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """A skeleton over time.

    root_positions: (T, 3) metres, world.
    rotations: (T, J, 4) unit quaternions (x, y, z, w), `R_parent_joint`.
    fps: frames a second.
    name: what the clip is called, for messages and lists.
    """

    skeleton: Skeleton
    root_positions: NDArray[np.float64]
    rotations: NDArray[np.float64]
    fps: float
    name: str = "motion"

    def __len__(self) -> int:
        return len(self.root_positions)

    @property
    def duration_s(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) / self.fps

    def pose(self, frame: int) -> Pose:
        """The pose of one frame."""
        return Pose(frame / self.fps, self.root_positions[frame], self.rotations[frame])
