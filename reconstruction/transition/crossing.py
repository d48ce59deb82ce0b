"""The frame left and the frame entered, seen from the world: what every part of a transition starts from."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from reconstruction.rotations import inverse, logarithm, multiply
from reconstruction.transition.clip import TransitionClip
from reconstruction.transition.curves import body_to_vector_rate
from reconstruction.transition.rebasing import Placement, heading_at
from reconstruction.transition.root_path import GRAVITY

FASTEST_RAD_S = 12.0
HARDEST_RAD_S2 = 60.0
"""What a quintic takes over of a clip's speeds and accelerations at the most: beyond is noise, or swings it too far."""


@dataclass(frozen=True)
class Crossing:
    """From frame `at` of clip `a` to frame `into` of clip `b`, which stands where `placement` puts it.

    Keys are what a quintic takes: value, speed and acceleration when left, the same when entered.
    """

    a: TransitionClip
    at: int
    b: TransitionClip
    into: int
    placement: Placement

    @cached_property
    def entered_rotations(self) -> NDArray[np.float64]:
        """(J, 4) the local rotations entered, the root's re-based."""
        entered = self.b.motion.rotations[self.into].copy()
        entered[0] = self.placement.rotations(entered[0])
        return entered

    @cached_property
    def root_keys(self) -> NDArray[np.float64]:
        """(6, 3) metres, m/s, m/s^2 of the root."""
        a, at, b, into = self.a, self.at, self.b, self.into
        rates = self.placement.vectors(np.stack((b.root_velocity[into], b.root_acceleration[into])))
        end = self.placement.points(b.motion.root_positions[into])
        return np.stack((a.motion.root_positions[at], a.root_velocity[at], a.root_acceleration[at], end, *rates))

    @cached_property
    def turn_keys(self) -> NDArray[np.float64]:
        """(6, J, 3) rotation vectors from the local rotations left, rad/s and rad/s^2."""
        a, at, b, into = self.a, self.at, self.b, self.into
        turn = logarithm(multiply(inverse(a.motion.rotations[at]), self.entered_rotations))
        rates = body_to_vector_rate(turn, np.stack((b.velocities[into], b.accelerations[into])))
        keys = np.stack((np.zeros_like(turn), a.velocities[at], a.accelerations[at], turn, *rates))
        keys[1::3] = _shortened(keys[1::3], FASTEST_RAD_S)
        keys[2::3] = _shortened(keys[2::3], HARDEST_RAD_S2)
        return keys

    @cached_property
    def ankle_keys(self) -> NDArray[np.float64]:
        """(6, F, 3) metres, m/s, m/s^2 of the ankles."""
        a, at, b, into = self.a, self.at, self.b, self.into
        end = self.placement.points(b.joints[into, self.ankles])
        rates = self.placement.vectors(np.stack((b.ankle_velocity[into], b.ankle_acceleration[into])))
        return np.stack((a.joints[at, self.ankles], a.ankle_velocity[at], a.ankle_acceleration[at], end, *rates))

    @cached_property
    def foot_keys(self) -> NDArray[np.float64]:
        """(6, F, 3) rotation vectors from the feet's world rotations left, rad/s and rad/s^2."""
        a, at, b, into = self.a, self.at, self.b, self.into
        end = self.placement.rotations(b.world_rotations[into, self.ankles])
        turn = logarithm(multiply(inverse(a.world_rotations[at, self.ankles]), end))
        rates = body_to_vector_rate(turn, np.stack((b.foot_velocity[into], b.foot_acceleration[into])))
        return np.stack((np.zeros_like(turn), a.foot_velocity[at], a.foot_acceleration[at], turn, *rates))

    @property
    def ankles(self) -> NDArray[np.int64]:
        """(F,) the ankles' joints."""
        return self.a.leg_joints[:, 2]

    @property
    def stands_out(self) -> NDArray[np.bool_]:
        """(F,) whether each foot is planted when left."""
        return self.a.planted[self.at]

    @property
    def stands_in(self) -> NDArray[np.bool_]:
        """(F,) whether each foot is planted when entered."""
        return self.b.planted[self.into]

    @cached_property
    def flight_s(self) -> float:
        """Seconds of free fall until the root is as high as when entered; 0 where a foot stands."""
        if self.stands_out.any() or not len(self.stands_out):
            return 0.0
        rise, drop = self.root_keys[1, 1], self.root_keys[0, 1] - self.root_keys[3, 1]
        return float(rise + np.sqrt(max(rise**2 + 2 * GRAVITY * drop, 0.0))) / GRAVITY

    @cached_property
    def gaps(self) -> NDArray[np.float64]:
        """(F,) metres over the ground from where each foot is to where it has to be."""
        way = self.ankle_keys[3] - self.ankle_keys[0]
        return np.hypot(way[:, 0], way[:, 2])

    @cached_property
    def left(self) -> NDArray[np.float64]:
        """(3,) unit: the body's left over the ground when left."""
        heading = heading_at(self.a, self.at)
        return np.array((np.cos(heading), 0.0, -np.sin(heading)))

    @cached_property
    def hinges(self) -> NDArray[np.float64]:
        """(F, 3) unit vectors: about what each knee bends, in the thigh's axes."""
        both = self.a.hinges + self.b.hinges
        return both / np.linalg.norm(both, axis=-1, keepdims=True)


def _shortened(vectors: NDArray[np.float64], longest: float) -> NDArray[np.float64]:
    """Vectors (..., 3), those longer than `longest` made so long."""
    length = np.sqrt(np.einsum("...k,...k->...", vectors, vectors))[..., None]
    return vectors * (longest / np.maximum(length, longest))
