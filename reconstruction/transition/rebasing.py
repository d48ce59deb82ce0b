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
from reconstruction.rotations import about_up, multiply
from reconstruction.transition.clip import TransitionClip


@dataclass(frozen=True)
class Placement:
    """T_world_clip: first a turn of `yaw` radians about +Y, then a shift (3,) metres."""

    yaw: float
    shift: NDArray[np.float64]

    def points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 3) of the clip, in the world."""
        return points @ self._matrix.T + self.shift

    def vectors(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Directions and speeds (..., 3) of the clip, in the world."""
        return vectors @ self._matrix.T

    def rotations(self, rotations: NDArray[np.float64]) -> NDArray[np.float64]:
        """World rotations (..., 4) of the clip, in the world."""
        return multiply(self.turn, rotations)

    @cached_property
    def turn(self) -> NDArray[np.float64]:
        """(4,) the turn as a quaternion."""
        return about_up(np.asarray(self.yaw))

    @cached_property
    def _matrix(self) -> NDArray[np.float64]:
        cosine, sine = np.cos(self.yaw), np.sin(self.yaw)
        return np.array(((cosine, 0.0, sine), (0.0, 1.0, 0.0), (-sine, 0.0, cosine)))

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
    turned = Placement(yaw, np.zeros(3)).points(clip.motion.root_positions[frame])
    shift = np.asarray(position, float) - turned
    shift[1] = 0.0
    return Placement(yaw, frozen(shift))


def heading_at(clip: TransitionClip, frame: int) -> float:
    """Radians about +Y from +Z that the clip's body faces at a frame."""
    return float(clip.headings[frame])
