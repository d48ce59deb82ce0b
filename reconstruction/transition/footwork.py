"""Where the feet go during a transition: planted feet are held, a foot that must move is lifted, one at a time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.rotations import multiply, rotate
from reconstruction.transition.clip import Leg, TransitionClip
from reconstruction.transition.crossing import Crossing
from reconstruction.transition.curves import quintic_weights, trend_weights, turned_by_kernel

SETTLE_S = 0.12
"""A planted foot's last motion dies away over this time."""
STILL_M = 0.01
"""A planted foot that is to stand no farther than this from where it stands is not lifted."""
SHORTEST_STEP_S = 0.3
_STEP_S_PER_M = 0.3
SWING_FADING_S = 0.3
"""The speed that a swinging foot has when left or entered fades within so long."""
ALOFT_SHARE = 0.6
"""A foot that is in the air already is lifted so much less."""
FEET_APART_M = 0.12
"""Ankles pass each other no nearer than this,"""
PASSING_M = 0.25
"""where one is less than this ahead of the other."""


@dataclass(frozen=True, slots=True)
class Step:
    """One foot's way: it stands (or comes) until `lift_s`, is under way until `land_s`, then stands (or goes on)."""

    lift_s: float
    land_s: float
    height_m: float


def step_time(distance_m: float) -> float:
    """Seconds that a step so far takes at the least."""
    return SHORTEST_STEP_S + _STEP_S_PER_M * distance_m


def least_time(out: NDArray[np.bool_], into: NDArray[np.bool_], gaps: NDArray[np.float64]) -> float:
    """Seconds that the steps between two stances need, one foot after the other.

    out, into: (F,) whether each foot is planted when left and when entered; gaps: (F,) metres that it has to go.
    """
    steps = [step_time(gap) for o, i, gap in zip(out, into, gaps, strict=True) if i and gap > STILL_M]
    return sum(steps) if steps else 0.0


def planned_steps(
    out: NDArray[np.bool_],
    into: NDArray[np.bool_],
    gaps: NDArray[np.float64],
    duration: float,
    flight_s: float = 0.0,
) -> list[Step]:
    """When each foot is under way, so that one foot stands while the other swings wherever a foot stands at all.

    Feet in the air land first, no sooner than a body in flight comes down (`flight_s`); then planted feet that have to
    move; feet that the next clip has in the air lift last.
    """
    gap = gaps.tolist()
    lands = sorted((f for f in range(len(out)) if not out[f] and into[f]), key=gap.__getitem__)
    moves = sorted((f for f in range(len(out)) if out[f] and into[f] and gap[f] > STILL_M), key=lambda f: -gap[f])
    lifts = sorted((f for f in range(len(out)) if out[f] and not into[f]), key=lambda f: -gap[f])
    phases = [*lands, *moves, *lifts]
    steps = [Step(0.0, duration, 0.0) for _ in out]
    for k, f in enumerate(phases):
        start, stop = duration * k / len(phases), duration * (k + 1) / len(phases)
        stop = min(max(stop, flight_s), duration)
        height = _lift(gap[f]) if out[f] else ALOFT_SHARE * _lift(gap[f])
        steps[f] = Step(start if out[f] else 0.0, stop if into[f] else duration, height)
    return steps


def _lift(gap_m: float) -> float:
    return min(0.03 + 0.15 * gap_m, 0.1)


def kept_apart(
    paths: NDArray[np.float64], steps: list[Step], left: NDArray[np.float64], t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The ankles' path (N, F, 3), bowed sideways where one foot would swing through the other leg.

    left: (3,) unit, the body's left over the ground; the first leg is the left one.
    """
    if len(steps) != 2 or not len(paths):
        return paths
    apart = paths[:, 0] - paths[:, 1]
    sideways = apart @ left
    ahead = np.linalg.norm(apart[:, [0, 2]] - sideways[:, None] * left[[0, 2]], axis=-1)
    missing = np.where(ahead < PASSING_M, FEET_APART_M - sideways, 0.0)
    bowed = paths.copy()
    for f, step in enumerate(steps):
        shape = _bump(np.clip((t - step.lift_s) / (step.land_s - step.lift_s), 0, 1))
        # A bow as wide as the worst frame needs, counted where the foot is well under way.
        needed = np.max(np.where(shape > 0.3, missing, 0.0), initial=0.0)
        side = left if f == 0 else -left
        bowed[:, f] += (min(needed, FEET_APART_M) * shape)[:, None] * side
    return bowed


def _bump(s: NDArray[np.float64]) -> NDArray[np.float64]:
    """0 at s = 0 and 1, 1 in the middle, with two smooth derivatives."""
    return 64 * (s * (1 - s)) ** 3


def ankle_paths(crossing: Crossing, steps: list[Step], t: NDArray[np.float64], duration: float) -> NDArray[np.float64]:
    """(N, F, 3) metres, world: where the ankles should be at times t (N,) after the frame left.

    A planted foot's way is a rest with what is left of its motion dying away on top.
    """
    paths = np.empty((len(t), len(steps), 3))
    settle = min(SETTLE_S, duration / 2)
    out_weights = quintic_weights(t, settle)[:, :3]
    in_weights = quintic_weights(t - (duration - settle), settle)[:, 3:]
    for f, step in enumerate(steps):
        keys = crossing.ankle_keys[:, f].copy()
        stands_out, stands_in = crossing.stands_out[f], crossing.stands_in[f]
        if stands_out:
            keys[:3] = keys[0] + 0.25 * SETTLE_S * keys[1], (0, 0, 0), (0, 0, 0)
        if stands_in:
            keys[3:] = keys[3] - 0.25 * SETTLE_S * keys[4], (0, 0, 0), (0, 0, 0)
        path = trend_weights(t - step.lift_s, step.land_s - step.lift_s, SWING_FADING_S) @ keys
        if stands_out:
            path += out_weights @ (crossing.ankle_keys[:3, f] - keys[:3])
        if stands_in:
            path += in_weights @ (crossing.ankle_keys[3:, f] - keys[3:])
        s = np.clip((t - step.lift_s) / (step.land_s - step.lift_s), 0, 1)
        path[:, 1] += step.height_m * _bump(s)
        paths[:, f] = path
    return paths


def foot_turns(crossing: Crossing, steps: list[Step], t: NDArray[np.float64], duration: float) -> NDArray[np.float64]:
    """(N, F, 4) world rotations of the feet at times t (N,), turning while their ankles are under way."""
    vectors = np.empty((len(t), len(steps), 3))
    settle = min(SETTLE_S, duration / 2)
    for f, step in enumerate(steps):
        weights = quintic_weights(t - step.lift_s, step.land_s - step.lift_s)
        if crossing.stands_out[f]:
            weights[:, 1:3] = quintic_weights(t, settle)[:, 1:3]
        if crossing.stands_in[f]:
            weights[:, 4:] = quintic_weights(t - (duration - settle), settle)[:, 4:]
        vectors[:, f] = weights @ crossing.foot_keys[:, f]
    return turned_by_kernel(crossing.a.world_rotations[crossing.at, crossing.ankles], vectors)


def raised_above_floor(
    a: TransitionClip,
    ankles: NDArray[np.float64],
    turns: NDArray[np.float64],
    rotations: NDArray[np.float64],
    floor: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The ankles' path (N, F, 3), lifted where ankle or toes would go below the floor.

    turns: (N, F, 4) world rotations of the feet; rotations: (N, J, 4) local ones, of which the toes' are used;
    floor: (N,) metres.
    """
    raised = ankles.copy()
    for f, leg in enumerate(a.legs):
        raised[:, f, 1] = np.maximum(ankles[:, f, 1], floor + _depth_below_ankle(a, leg, turns[:, f], rotations))
    return raised


def _depth_below_ankle(
    a: TransitionClip, leg: Leg, turn: NDArray[np.float64], rotations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) metres: how far the lowest joint of the toes lies below the ankle, 0 where none does."""
    skeleton = a.skeleton
    height, world = {leg.ankle: np.zeros(len(turn))}, {leg.ankle: turn}
    depth = np.zeros(len(turn))
    for joint in leg.toes:
        parent = int(skeleton.parents[joint])
        height[joint] = height[parent] + rotate(world[parent], skeleton.offsets[joint])[:, 1]
        if skeleton.children[joint]:
            world[joint] = multiply(world[parent], rotations[:, joint])
        depth = np.maximum(depth, -height[joint])
    return depth
