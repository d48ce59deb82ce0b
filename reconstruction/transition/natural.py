"""The default transition: the paper's idea, with seams that are smooth and feet that stand.

As in the paper the time varies with how far and how fast the joints have to go, and the root keeps its trend; beyond
it, joints follow quintics that meet both clips' speeds and accelerations, the time is made long enough that no joint
accelerates harder than the clips themselves do, planted feet are held and others step, the floor and the joints' limits
are kept, a standing body stays over its feet, and arms keep out of the trunk.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.transition.arms_clear import cleared_arms
from reconstruction.transition.balance import balancing_shift
from reconstruction.transition.classification import MotionClass
from reconstruction.transition.clip import TransitionClip
from reconstruction.transition.crossing import Crossing
from reconstruction.transition.curves import (
    peak_acceleration_kernel,
    quintic_weights,
    trend_weights,
    turned_by_kernel,
)
from reconstruction.transition.footwork import (
    SETTLE_S,
    ankle_paths,
    foot_turns,
    kept_apart,
    least_time,
    planned_steps,
    raised_above_floor,
)
from reconstruction.transition.joint_limits import keep_within_kernel, limits_of
from reconstruction.transition.leg_reach import SOFT_FROM, reach_legs_kernel
from reconstruction.transition.rebasing import Placement, heading_at, placed_at
from reconstruction.transition.result import Transition, between_motion, frame_count
from reconstruction.transition.timing import DEFAULT_BOUNDS, TimeBounds, paper_time
from reconstruction.transition.world_joints_kernel import joint_positions_kernel

SHARED_FOOT_M = 0.2
"""The next clip is put onto the foot that stands in both, if that is no farther than this from where the trend goes."""
GENTLE_RAD_S2 = 20.0
"""No joint is slowed down below this acceleration, however still the clips are."""
UNHURRIED_S = 0.6
"""Eq. 5 asks for more than this only where joints are far apart and the clips slow; the accelerations decide then."""
FADING_S = 0.4
"""The speeds of the clips' joints and the rise and fall of the root fade within so long, however long the way."""
_LONGER = (1.15, 1.6)
"""By how much the time grows at once while a joint accelerates too hard."""
_WORTH = 0.9
"""A longer transition is kept only if its peak falls below this share."""


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
    """From frame `at` of `a` into frame `into` of `b`; see the module.

    The time is at most `bounds.longest_s`, or what the steps of the feet need where that is more.
    """
    heading = heading_at(a, at)
    facing = placed_at(b, into, a.motion.root_positions[at], heading)
    time = min(paper_time(a, at, b, into, facing.rotations(b.motion.rotations[into, 0]), bounds), UNHURRIED_S)
    limit = max(a.own_acceleration, b.own_acceleration, GENTLE_RAD_S2)
    draft = _drafted(a, at, b, into, heading, time)
    while draft.peak > limit and draft.duration * 1.05 < bounds.longest_s:
        # Accelerations fall with the square of the time.
        longer = draft.duration * float(np.clip(np.sqrt(draft.peak / limit), *_LONGER))
        slower = _drafted(a, at, b, into, heading, min(longer, bounds.longest_s))
        if slower.peak > _WORTH * draft.peak:
            break
        draft = slower
    crossing = Crossing(a, at, b, into, draft.placement)
    between = between_motion(a, draft.positions, _with_clear_arms(crossing, draft.positions, draft.rotations))
    return Transition(between, draft.duration, draft.placement, "natural")


def _drafted(a: TransitionClip, at: int, b: TransitionClip, into: int, heading: float, time: float) -> _Draft:
    """The transition that takes `time` seconds, or what its steps need at the least."""
    crossing = Crossing(a, at, b, into, _placement(a, at, b, into, heading, time))
    if a.legs:
        time = max(time, least_time(crossing.stands_out, crossing.stands_in, crossing.gaps), crossing.flight_s)
    count = frame_count(time, a.fps)
    time = (count + 1) / a.fps
    t = np.arange(1, count + 1) / a.fps
    weights = trend_weights(t, time, FADING_S)
    positions = quintic_weights(t, time) @ crossing.root_keys
    positions[:, 1] = weights @ crossing.root_keys[:, 1]
    vectors = (weights @ crossing.turn_keys.reshape(6, -1)).reshape(count, -1, 3)
    rotations = turned_by_kernel(a.motion.rotations[at].copy(), vectors)
    keep_within_kernel(rotations, *limits_of(crossing))
    if a.legs and count:
        positions = _on_its_feet(crossing, positions, rotations, t, time)
    return _Draft(positions, rotations, time, crossing.placement, _peak(crossing, rotations))


def _placement(a: TransitionClip, at: int, b: TransitionClip, into: int, heading: float, time: float) -> Placement:
    """Where the next clip goes: onto the foot that stands in both, else where the root's trend leads.

    The trend is eq. 12 with the acceleration that leads from the one clip's speed to the other's. The floors of both
    clips come to the same height.
    """
    start = a.motion.root_positions[at]
    still = placed_at(b, into, start, heading)
    trend = start + time / 2 * (a.root_velocity[at] + still.vectors(b.root_velocity[into]))
    shift = placed_at(b, into, trend, heading).shift + np.array((0.0, a.floor_m - b.floor_m, 0.0))
    placement = Placement(still.yaw, shift)
    chosen, best = placement, SHARED_FOOT_M
    for f, leg in enumerate(a.legs):
        if a.planted[at, f] and b.planted[into, f]:
            onto = a.joints[at, leg.ankle] - placement.points(b.joints[into, leg.ankle])
            onto[1] = 0.0
            if np.linalg.norm(onto) < best:
                best, chosen = float(np.linalg.norm(onto)), Placement(still.yaw, shift + onto)
    return chosen


def _on_its_feet(
    crossing: Crossing,
    positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
    t: NDArray[np.float64],
    time: float,
) -> NDArray[np.float64]:
    """Root positions (N, 3) in balance; the legs of `rotations` are changed in place to where the feet should be."""
    a, b = crossing.a, crossing.b
    steps = planned_steps(crossing.stands_out, crossing.stands_in, crossing.gaps, time, crossing.flight_s)
    ankles = kept_apart(ankle_paths(crossing, steps, t, time), steps, crossing.left, t)
    feet = foot_turns(crossing, steps, t, time)
    settle = min(SETTLE_S, time / 2)
    leaving = quintic_weights(t, settle)[:, 0]
    entering = quintic_weights(t - (time - settle), settle)[:, 3]
    # A clip's own foot may dip below its floor: next to the seam it is let come up, not snapped up.
    below = (max(a.floor_m - _lowest(a, crossing.at), 0.0), max(b.floor_m - _lowest(b, crossing.into), 0.0))
    floor = a.floor_m - below[0] * leaving - below[1] * entering
    ankles = raised_above_floor(a, ankles, feet, rotations, floor)
    if a.motion_class is b.motion_class is MotionClass.ON_THE_SPOT:
        joints, _ = joint_positions_kernel(a.skeleton.parents, a.skeleton.offsets, positions, rotations)
        centre = np.einsum("j,njk->nk", a.mass_weights, joints)
        middles = np.stack([joints[:, [leg.ankle, *leg.toes[:1]]].mean(axis=1) for leg in a.legs], axis=1)
        middles += ankles - joints[:, crossing.ankles]
        positions = positions + balancing_shift(crossing, centre, middles, steps, t, 1 - leaving - entering)
    soft_from = np.clip(np.maximum(a.stretch(crossing.at), b.stretch(crossing.into)), *SOFT_FROM)
    body = (a.skeleton.parents, a.skeleton.offsets, a.leg_joints)
    seam = leaving + entering
    reach_legs_kernel(*body, positions, rotations, ankles, feet, crossing.hinges, seam, soft_from)
    return positions


def _with_clear_arms(
    crossing: Crossing, positions: NDArray[np.float64], rotations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, J, 4) rotations whose forearms stay out of the body; see `cleared_arms`."""
    if not len(rotations) or not len(crossing.a.capsules[0]):
        return rotations
    left = crossing.a.motion.rotations[crossing.at : crossing.at + 1]
    whole = np.concatenate([left, rotations, crossing.entered_rotations[None]])
    path = np.concatenate([crossing.root_keys[:1], positions, crossing.root_keys[3:4]])
    return cleared_arms(crossing.a.skeleton, path, whole, crossing.a.capsules, crossing.a.fps)[1:-1].copy()


def _lowest(clip: TransitionClip, frame: int) -> float:
    """Metres: the height of the lowest joint of the feet."""
    return float(min(clip.joints[frame, [leg.ankle, *leg.toes], 1].min() for leg in clip.legs))


def _peak(crossing: Crossing, rotations: NDArray[np.float64]) -> float:
    """rad/s^2: the hardest acceleration of any joint from the frame left to the frame entered."""
    at, into = crossing.at, crossing.into
    before = crossing.a.motion.rotations[max(at - 1, 0) : at + 1]
    after = crossing.b.motion.rotations[into : into + 2].copy()
    after[:, 0] = crossing.placement.rotations(after[:, 0])
    return float(peak_acceleration_kernel(np.concatenate([before, rotations, after]), crossing.a.fps))
