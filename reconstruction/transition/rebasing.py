"""Where the next clip goes: the turn about up and the shift that put its entry frame where the transition ends.

Section 5.4: clips come in coordinates of their own; the next clip's ground position and heading are set from where the
character is, so that the path neither jumps nor turns at once.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from devices.frame import frozen
from reconstruction.motion import Motion
from reconstruction.rotations import about_up, multiply, rotate
from reconstruction.transition.clip import TransitionClip


@dataclass(frozen=True)
class Placement:
    """T_world_clip: first a turn of `yaw` radians about +Y, then a shift (3,) metres."""

    yaw: float
    shift: NDArray[np.float64]

    def points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 3) of the clip, in the world."""
        return rotate(self.turn, points) + self.shift

    def vectors(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Directions and speeds (..., 3) of the clip, in the world."""
        return rotate(self.turn, vectors)

    def rotations(self, rotations: NDArray[np.float64]) -> NDArray[np.float64]:
        """World rotations (..., 4) of the clip, in the world."""
        return multiply(self.turn, rotations)

    @cached_property
    def turn(self) -> NDArray[np.float64]:
        """(4,) the turn as a quaternion."""
        return about_up(np.asarray(self.yaw))

    def within(self, outer: "Placement") -> "Placement":
        """This placement in a clip that is itself placed by `outer`."""
        return Placement(self.yaw + outer.yaw, frozen(outer.points(self.shift)))

    def motion(self, motion: Motion) -> Motion:
        """A whole motion of the clip, in the world."""
        rotations = motion.rotations.copy()
        rotations[:, 0] = self.rotations(rotations[:, 0])
        return replace(motion, root_positions=frozen(self.points(motion.root_positions)), rotations=frozen(rotations))


def placed_at(clip: TransitionClip, frame: int, position: NDArray[np.float64], heading: float) -> Placement:
    """The placement that puts the clip's root over `position` (its ground part counts) at `frame`, facing `heading`.

    position: (3,) metres; heading: radians about +Y from +Z. The clip's heights stay.
    """
    yaw = heading - heading_at(clip, frame)
    turned = rotate(about_up(np.asarray(yaw)), clip.motion.root_positions[frame])
    shift = np.asarray(position, float) - turned
    shift[1] = 0.0
    return Placement(float(yaw), frozen(shift))


def heading_at(clip: TransitionClip, frame: int) -> float:
    """Radians about +Y from +Z: where hips and shoulders face; the root's own +Z where there are none.

    From joint positions, since joints' own axes differ from skeleton to skeleton.
    """
    bones = clip.skeleton.humanoid
    across = np.zeros(3)
    for bone in ("upper_leg", "upper_arm"):
        if f"left_{bone}" in bones and f"right_{bone}" in bones:
            side = clip.joints[frame, bones[f"left_{bone}"]] - clip.joints[frame, bones[f"right_{bone}"]]
            across += side / max(float(np.linalg.norm(side)), 1e-9)
    if np.hypot(across[0], across[2]) < 1e-6:
        forward = rotate(clip.world_rotations[frame, 0], np.array([0.0, 0.0, 1.0]))
        return float(np.arctan2(forward[0], forward[2]))
    return float(np.arctan2(-across[2], across[0]))
