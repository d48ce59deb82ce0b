"""The default transition: the paper's idea, with seams that are smooth and feet that stand.

As in the paper the time varies with how far and how fast the joints have to go, and the root keeps its trend; beyond
it, joints follow quintics that meet both clips' speeds and accelerations, the time is made long enough that no joint
accelerates harder than the clips themselves do, planted feet are held and others step, and the floor is kept.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.rotations import inverse, logarithm, multiply
from reconstruction.transition.clip import TransitionClip
from reconstruction.transition.curves import (
    body_to_vector_rate,
    peak_acceleration_kernel,
    quintic_weights,
    trend_weights,
    turned_by_kernel,
)
from reconstruction.transition.footwork import (
    SETTLE_S,
    ankle_paths,
    foot_turns,
    least_time,
    planned_steps,
    raised_above_floor,
)
from reconstruction.transition.leg_reach import reach_legs_kernel
from reconstruction.transition.rebasing import Placement, heading_at, placed_at
from reconstruction.transition.result import Transition, between_motion, frame_count
from reconstruction.transition.timing import DEFAULT_BOUNDS, TimeBounds, paper_time

SHARED_FOOT_M = 0.2
"""The next clip is put onto the foot that stands in both, if that is no farther than this from where the trend goes."""
GENTLE_RAD_S2 = 20.0
"""No joint is slowed down below this acceleration, however still the clips are."""
UNHURRIED_S = 0.6
"""Eq. 5 asks for more than this only where joints are far apart and the clips slow; the accelerations decide then."""
FADING_S = 0.4
"""The speeds of the clips' joints and the rise and fall of the root fade within so long, however long the way."""
_LONGER = 1.3
"""The step by which the time grows while a joint accelerates too hard."""


@dataclass(frozen=True, slots=True)
class _Draft:
    """A transition of a given time, and how hard its joints accelerate."""

    positions: NDArray[np.float64]
    rotations: NDArray[np.float64]
    duration: float
    placement: Placement
    peak: float


def natural_transition(
    a: TransitionClip, at: int, b: TransitionClip, into: int, bounds: TimeBounds = DEFAULT_BOUNDS
) -> Transition:
    """From frame `at` of `a` into frame `into` of `b`; see the module."""
    heading = heading_at(a, at)
    facing = placed_at(b, into, a.motion.root_positions[at], heading)
    time = min(paper_time(a, at, b, into, facing.rotations(b.motion.rotations[into, 0]), bounds), UNHURRIED_S)
    limit = max(a.own_acceleration, b.own_acceleration, GENTLE_RAD_S2)
    draft = _drafted(a, at, b, into, heading, time)
    while draft.peak > limit and draft.duration * 1.05 < bounds.longest_s:
        longer = _drafted(a, at, b, into, heading, min(draft.duration * _LONGER, bounds.longest_s))
        if longer.peak > 0.9 * draft.peak:
            break
        draft = longer
    return Transition(between_motion(a, draft.positions, draft.rotations), draft.duration, draft.placement, "natural")


def _drafted(a: TransitionClip, at: int, b: TransitionClip, into: int, heading: float, time: float) -> _Draft:
    """The transition that takes `time` seconds, or what its steps need at the least."""
    placement = _placement(a, at, b, into, heading, time)
    out, planted = a.planted[at], b.planted[into]
    gaps = _gaps(a, at, b, into, placement)
    time = max(time, least_time(out, planted, gaps))
    count = frame_count(time, a.fps)
    time = (count + 1) / a.fps
    t = np.arange(1, count + 1) / a.fps
    weights = trend_weights(t, time, FADING_S)
    keys = _root_keys(a, at, b, into, placement)
    positions = quintic_weights(t, time) @ keys
    positions[:, 1] = weights @ keys[:, 1]
    rotations = _turned(a, at, b, into, placement, weights)
    if a.legs and count:
        steps = planned_steps(out, planted, gaps, time)
        ankles = ankle_paths(a, at, b, into, placement, steps, t, time)
        feet = foot_turns(a, at, b, into, placement, steps, t, time)
        settle = min(SETTLE_S, time / 2)
        leaving = quintic_weights(t, settle)[:, 0]
        entering = quintic_weights(t - (time - settle), settle)[:, 3]
        # A clip's own foot may dip below its floor: next to the seam it is let come up, not snapped up.
        below = (max(a.floor_m - _lowest(a, at), 0.0), max(b.floor_m - _lowest(b, into), 0.0))
        floor = a.floor_m - below[0] * leaving - below[1] * entering
        ankles = raised_above_floor(a, ankles, feet, rotations, floor)
        hinges = a.hinges + b.hinges
        hinges /= np.linalg.norm(hinges, axis=-1, keepdims=True)
        reach_legs_kernel(
            a.skeleton.parents,
            a.skeleton.offsets,
            a.leg_joints,
            positions,
            rotations,
            ankles,
            feet,
            hinges,
            leaving + entering,
        )
    return _Draft(positions, rotations, time, placement, _peak(a, at, b, into, placement, rotations))


def _placement(a: TransitionClip, at: int, b: TransitionClip, into: int, heading: float, time: float) -> Placement:
    """Where the next clip goes: onto the foot that stands in both, else where the root's trend leads.

    The trend is eq. 12 with the acceleration that leads from the one clip's speed to the other's.
    """
    start = a.motion.root_positions[at]
    still = placed_at(b, into, start, heading)
    trend = start + time / 2 * (a.root_velocity[at] + still.vectors(b.root_velocity[into]))
    placement = placed_at(b, into, trend, heading)
    placement = Placement(placement.yaw, placement.shift + np.array((0.0, a.floor_m - b.floor_m, 0.0)))
    chosen, best = placement, SHARED_FOOT_M
    for f, leg in enumerate(a.legs):
        if a.planted[at, f] and b.planted[into, f]:
            shift = a.joints[at, leg.ankle] - placement.points(b.joints[into, leg.ankle])
            shift[1] = 0.0
            if np.linalg.norm(shift) < best:
                best, chosen = float(np.linalg.norm(shift)), Placement(placement.yaw, placement.shift + shift)
    return chosen


def _gaps(a: TransitionClip, at: int, b: TransitionClip, into: int, placement: Placement) -> NDArray[np.float64]:
    """(F,) metres over the ground from where each foot is to where it has to be."""
    ankles = [leg.ankle for leg in a.legs]
    way = placement.points(b.joints[into, ankles]) - a.joints[at, ankles]
    return np.linalg.norm(way[:, [0, 2]], axis=-1)


def _lowest(clip: TransitionClip, frame: int) -> float:
    """Metres: the height of the lowest joint of the feet."""
    return float(min(clip.joints[frame, [leg.ankle, *leg.toes], 1].min() for leg in clip.legs))


def _root_keys(a: TransitionClip, at: int, b: TransitionClip, into: int, placement: Placement) -> NDArray[np.float64]:
    """(6, 3) position, speed and acceleration of the root at both ends."""
    rates = placement.vectors(np.stack((b.root_velocity[into], b.root_acceleration[into])))
    end = placement.points(b.motion.root_positions[into])
    return np.stack((a.motion.root_positions[at], a.root_velocity[at], a.root_acceleration[at], end, *rates))


def _turned(
    a: TransitionClip, at: int, b: TransitionClip, into: int, placement: Placement, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, J, 4) rotations on quintics from the frame left to the frame entered."""
    left = a.motion.rotations[at]
    entered = b.motion.rotations[into].copy()
    entered[0] = placement.rotations(entered[0])
    turn = logarithm(multiply(inverse(left), entered))
    rates = body_to_vector_rate(turn, np.stack((b.velocities[into], b.accelerations[into])))
    keys = np.stack((a.velocities[at], a.accelerations[at], turn, *rates))
    vectors = (weights[:, 1:] @ keys.reshape(5, -1)).reshape(len(weights), -1, 3)
    return turned_by_kernel(left.copy(), vectors)


def _peak(
    a: TransitionClip, at: int, b: TransitionClip, into: int, placement: Placement, rotations: NDArray[np.float64]
) -> float:
    """rad/s^2: the hardest acceleration of any joint from the frame left to the frame entered."""
    before, after = a.motion.rotations[max(at - 1, 0) : at + 1], b.motion.rotations[into : into + 2].copy()
    after[:, 0] = placement.rotations(after[:, 0])
    return float(peak_acceleration_kernel(np.concatenate([before, rotations, after]), a.fps))
