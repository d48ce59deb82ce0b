"""The coordinates `q` of the reconstruction: angles about mean rotations, the root seen from a heading frame.

q = [root position (3), root turn (3), rotation vector of each moving joint (3 each)], D numbers:

- a **heading frame** (x, z, yaw) stands on the floor under the root and looks where the hips face; root position and
  root turn are relative to one, so that the same movement has the same numbers wherever it happens and whichever
  way it faces;
- each joint's rotation vector is relative to that joint's mean rotation over the database, R = mean * exp(w), the
  root's to its mean tilt, R = exp(w) * mean: no jumps inside the range people move in.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.motion import Motion, Pose
from reconstruction.rotations import (
    about_up,
    exponential,
    inverse,
    logarithm,
    mean_of_sum,
    multiply,
    outer_sum,
    rotate,
    twist_about_up,
    wrapped,
)
from reconstruction.skeleton import Skeleton

ROOT_DOF = 6


@dataclass(frozen=True, eq=False)
class PoseSpace:
    """What the numbers of `q` mean.

    skeleton: the body, J joints.
    mean: (J, 4) mean local rotations; the root's is its mean tilt, as seen from its own heading frame.
    moving: (A,) joints, the root left out, that turn at all; D = 6 + 3 A.
    """

    skeleton: Skeleton
    mean: NDArray[np.float64]
    moving: NDArray[np.int32]

    @property
    def dof(self) -> int:
        """D, degrees of freedom."""
        return ROOT_DOF + 3 * len(self.moving)

    def with_skeleton(self, skeleton: Skeleton) -> "PoseSpace":
        """The same coordinates on a body of the same joints but other proportions."""
        return PoseSpace(skeleton, self.mean, self.moving)

    def heading(self, root_position: NDArray[np.float64], root_rotation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Own heading frames (..., 3) = x, z metres, yaw radians, of roots at (..., 3) with rotations (..., 4)."""
        yaw = twist_about_up(multiply(root_rotation, inverse(self.mean[0])))
        return np.stack((root_position[..., 0], root_position[..., 2], yaw), axis=-1)

    def coordinates(
        self, root_positions: NDArray[np.float64], rotations: NDArray[np.float64], heading: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """q (T, D) of root positions (T, 3) and local rotations (T, J, 4), seen from heading frames (T, 3) or (3,)."""
        heading = np.broadcast_to(heading, (len(root_positions), 3))
        turn_back = about_up(-heading[:, 2])
        relative = root_positions - np.stack((heading[:, 0], 0 * heading[:, 0], heading[:, 1]), axis=-1)
        root = multiply(multiply(turn_back, rotations[:, 0]), inverse(self.mean[0]))
        joints = logarithm(multiply(inverse(self.mean[self.moving]), rotations[:, self.moving]))
        return np.concatenate((rotate(turn_back, relative), logarithm(root), joints.reshape(len(joints), -1)), axis=1)

    def rotations(self, q: NDArray[np.float64], heading: NDArray[np.float64]) -> NDArray[np.float64]:
        """Local rotations (T, J, 4) of q (T, D) seen from heading frames (T, 3) or (3,)."""
        heading = np.broadcast_to(heading, (len(q), 3))
        local = np.tile(self.mean, (len(q), 1, 1))
        local[:, 0] = multiply(about_up(heading[:, 2]), multiply(exponential(q[:, 3:6]), self.mean[0]))
        turns = exponential(q[:, ROOT_DOF:].reshape(len(q), -1, 3))
        local[:, self.moving] = multiply(self.mean[self.moving], turns)
        return local

    def root_positions(self, q: NDArray[np.float64], heading: NDArray[np.float64]) -> NDArray[np.float64]:
        """Root positions (T, 3) metres, world, of q (T, D) seen from heading frames (T, 3) or (3,)."""
        heading = np.broadcast_to(heading, (len(q), 3))
        ground = np.stack((heading[:, 0], 0 * heading[:, 0], heading[:, 1]), axis=-1)
        return ground + rotate(about_up(heading[:, 2]), q[:, :3])

    def motion(self, q: NDArray[np.float64], heading: NDArray[np.float64], fps: float, name: str) -> Motion:
        """The motion of q (T, D) seen from heading frames (T, 3)."""
        return Motion(self.skeleton, self.root_positions(q, heading), self.rotations(q, heading), fps, name)

    def pose(self, q: NDArray[np.float64], heading: NDArray[np.float64], time_s: float) -> Pose:
        """The pose of one q (D,) seen from a heading frame (3,)."""
        return Pose(time_s, self.root_positions(q[None], heading)[0], self.rotations(q[None], heading)[0])


def hips_left(skeleton: Skeleton) -> NDArray[np.float64]:
    """Unit vector (3,) from the right hip to the left, in the root's frame; +X where the skeleton has no named hips."""
    bones = skeleton.humanoid
    if "left_upper_leg" not in bones or "right_upper_leg" not in bones:
        return np.array([1.0, 0.0, 0.0])
    left = _from_root(skeleton, bones["left_upper_leg"]) - _from_root(skeleton, bones["right_upper_leg"])
    return left / max(float(np.linalg.norm(left)), 1e-12)


def facing(skeleton: Skeleton, root_rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Yaw (...,) radians that the hips face (left x up) for root rotations (..., 4)."""
    left = rotate(root_rotations, np.broadcast_to(hips_left(skeleton), (*root_rotations.shape[:-1], 3)))
    return wrapped(np.arctan2(-left[..., 2], left[..., 0]))


class MeanRotations:
    """Gathers, motion by motion, what a pose space needs: mean rotations and which joints move."""

    STILL_RAD = 2e-3
    """A joint whose rotations all stay this near their mean is taken as fixed."""

    def __init__(self, skeleton: Skeleton):
        self.skeleton = skeleton
        self._outer = np.zeros((len(skeleton), 4, 4))
        self._frames = 0

    def add(self, rotations: NDArray[np.float64]) -> None:
        """Counts the local rotations (T, J, 4) of one motion."""
        seen = rotations.astype(np.float64)
        seen[:, 0] = multiply(about_up(-facing(self.skeleton, seen[:, 0])), seen[:, 0])
        self._outer += outer_sum(seen)
        self._frames += len(seen)

    def pose_space(self) -> PoseSpace:
        """The pose space of everything counted so far."""
        mean = mean_of_sum(self._outer)
        # The mean of 4 (1 - (q . mean)^2) is the mean squared angle, for small angles.
        agreement = np.einsum("ja,jab,jb->j", mean, self._outer, mean) / max(self._frames, 1)
        spread = np.sqrt(np.maximum(4 * (1 - agreement), 0))
        moves = (spread > self.STILL_RAD) & ~self.skeleton.is_end
        moves[0] = False
        return PoseSpace(self.skeleton, mean, np.flatnonzero(moves).astype(np.int32))


def _from_root(skeleton: Skeleton, joint: int) -> NDArray[np.float64]:
    """Sum (3,) of the rest offsets from the root's first level down to a joint."""
    total = np.zeros(3)
    while skeleton.parents[joint] >= 0:
        total += skeleton.offsets[joint]
        joint = int(skeleton.parents[joint])
    return total
