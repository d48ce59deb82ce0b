"""What games do instead: direct switch, fixed cross-fade, inertialised blending. To be measured against."""

import numpy as np
from numpy.typing import NDArray

from reconstruction.interpolation import slerp
from reconstruction.motion_operations import sampled
from reconstruction.rotations import exponential, inverse, logarithm, multiply
from reconstruction.transition.clip import TransitionClip
from reconstruction.transition.curves import quintic_weights
from reconstruction.transition.hierarchy import variable_speed_parameter
from reconstruction.transition.rebasing import Placement, heading_at, placed_at
from reconstruction.transition.result import Transition, between_motion
from reconstruction.transition.root_path import root_derivatives

BLEND_S = 0.25


def direct_switch(a: TransitionClip, at: int, b: TransitionClip, into: int) -> Transition:
    """The next clip follows at once, its root where the last one's was, facing as it did."""
    placement = placed_at(b, into, a.motion.root_positions[at], heading_at(a, at))
    nothing = between_motion(a, np.empty((0, 3)), np.empty((0, len(a.skeleton), 4)))
    return Transition(nothing, 1 / a.fps, placement, "switch")


def cross_fade(a: TransitionClip, at: int, b: TransitionClip, into: int, blend_s: float = BLEND_S) -> Transition:
    """Both clips play on and are mixed over `blend_s` seconds, the mix easing in and out."""
    placement = placed_at(b, into, a.motion.root_positions[at], heading_at(a, at))
    steps = _blend_steps(a, b, into, blend_s)
    h = variable_speed_parameter(steps / (len(steps) + 1))
    a_positions, a_rotations = sampled(a.motion, at + steps.astype(float))
    b_positions, b_rotations = _placed(b, into, steps, placement)
    positions = (1 - h)[:, None] * a_positions + h[:, None] * b_positions
    rotations = slerp(a_rotations, b_rotations, h[:, None])
    return Transition(between_motion(a, positions, rotations), blend_s, placement, "cross-fade", len(steps))


def inertialised(a: TransitionClip, at: int, b: TransitionClip, into: int, blend_s: float = BLEND_S) -> Transition:
    """The next clip plays, and the offset of the frame left from it decays over `blend_s` seconds.

    D. Bollo, "Inertialization: High-Performance Animation Transitions in Gears of War", GDC 2018: a quintic from the
    offset and its speed to none, every joint for itself.
    """
    placement = placed_at(b, into, a.motion.root_positions[at], heading_at(a, at))
    steps = _blend_steps(a, b, into, blend_s)
    b_positions, b_rotations = _placed(b, into, steps, placement)
    entered = b.motion.rotations[into].copy()
    entered[0] = placement.rotations(entered[0])
    offset = logarithm(multiply(inverse(entered), a.motion.rotations[at]))
    speed = a.velocities[at] - b.velocities[into]
    t, whole = steps / a.fps, (len(steps) + 1) / a.fps
    rotations = multiply(b_rotations, exponential(_decay(offset, speed, t, whole)))
    a_speed, _ = root_derivatives(a.motion.root_positions, at, a.fps)
    b_speed, _ = root_derivatives(b.motion.root_positions, into, b.fps)
    gap = a.motion.root_positions[at] - placement.points(b.motion.root_positions[into])
    positions = b_positions + _decay(gap, a_speed - placement.vectors(b_speed), t, whole)
    return Transition(between_motion(a, positions, rotations), blend_s, placement, "inertialised", len(steps))


def _blend_steps(a: TransitionClip, b: TransitionClip, into: int, blend_s: float) -> NDArray[np.int64]:
    """1, 2, 3 ...: frames after the one left, as many as the blend takes and the next clip has."""
    return np.arange(1, max(min(round(blend_s * a.fps), len(b) - into), 1))


def _placed(
    b: TransitionClip, into: int, steps: NDArray[np.int64], placement: Placement
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Root positions and rotations of the next clip while it is blended in, re-based."""
    positions, rotations = sampled(b.motion, (into + steps - 1).astype(float))
    rotations[:, 0] = placement.rotations(rotations[:, 0])
    return placement.points(positions), rotations


def _decay(
    offset: NDArray[np.float64], speed: NDArray[np.float64], t: NDArray[np.float64], whole: float
) -> NDArray[np.float64]:
    """(N, ...) the quintic from `offset` and `speed`, without acceleration, to rest at none after `whole` seconds."""
    weights = quintic_weights(t, whole)[:, :2]
    return np.tensordot(weights, np.stack((offset, speed)), axes=1)
