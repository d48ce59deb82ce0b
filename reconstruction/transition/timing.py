"""How long a transition takes: the paper's section 4, eq. 1-5, from the hips, legs and feet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.rotations import inverse, logarithm, multiply
from reconstruction.transition.clip import TransitionClip


@dataclass(frozen=True, slots=True)
class TimeBounds:
    """Between which seconds a transition's time is kept."""

    shortest_s: float = 0.1
    longest_s: float = 1.2


DEFAULT_BOUNDS = TimeBounds()


def paper_time(
    a: TransitionClip, at: int, b: TransitionClip, into: int, turned_root: NDArray[np.float64], bounds: TimeBounds
) -> float:
    """Eq. 5: T, the longest time (seconds) that any of hips, legs and feet needs, within the bounds.

    turned_root: (4,) the root's world rotation at the entry frame, re-based.
    """
    joints = timing_joints(a)
    entered = b.motion.rotations[into].copy()
    entered[0] = turned_root
    turn = logarithm(multiply(inverse(a.motion.rotations[at, joints]), entered[joints]))
    typical = np.minimum(a.typical_speed, b.typical_speed)[joints]
    times = joint_times(turn, a.velocities[at, joints], b.velocities[into, joints], typical)
    return float(np.clip(times.max(initial=0.0), bounds.shortest_s, bounds.longest_s))


def timing_joints(clip: TransitionClip) -> list[int]:
    """The root and the joints of the legs."""
    return [0, *(joint for leg in clip.legs for joint in (leg.hip, leg.knee, leg.ankle))]


def joint_times(
    turn: NDArray[np.float64],
    speed_out: NDArray[np.float64],
    speed_in: NDArray[np.float64],
    typical: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Eq. 3, `t = 2 dtheta / (w1 + w2)`, seconds, for each joint.

    turn: (N, 3) rotation vector from the frame left to the frame entered, eq. 4 (whose arccos gives half the angle);
    speed_out, speed_in: (N, 3) rad/s at these frames; typical: (N,) rad/s, the joint's usual speed.

    Erratum: eq. 3 divides an angle by what eq. 2 calls an acceleration. With one constant acceleration across the
    transition the mean of the two end speeds about the axis of the turn is what the angle is divided by. Where these
    oppose the turn or are slower than usual for the joint, the usual speed stands in.
    """
    angle = np.linalg.norm(turn, axis=-1)
    axis = turn / np.maximum(angle, 1e-12)[:, None]
    mean_speed = np.sum((speed_out + speed_in) / 2 * axis, axis=-1)
    return angle / np.maximum(np.maximum(mean_speed, typical), 1e-3)
