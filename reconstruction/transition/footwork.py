"""Where the feet go during a transition: planted feet are held, a foot that must move is lifted, one at a time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.rotations import inverse, logarithm, multiply, rotate
from reconstruction.transition.clip import Leg, TransitionClip
from reconstruction.transition.curves import body_to_vector_rate, quintic_weights, turned_by
from reconstruction.transition.rebasing import Placement

SETTLE_S = 0.12
"""A planted foot's last motion dies away over this time."""
STILL_M = 0.01
"""A planted foot that is to stand no farther than this from where it stands is not lifted."""
SHORTEST_STEP_S = 0.3
_STEP_S_PER_M = 0.3


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
    out: NDArray[np.bool_], into: NDArray[np.bool_], gaps: NDArray[np.float64], duration: float
) -> list[Step]:
    """When each foot is under way, so that one foot stands while the other swings wherever a foot stands at all.

    Feet in the air land first; then planted feet that have to move; feet that the next clip has in the air lift last.
    """
    gap = gaps.tolist()
    lands = sorted((f for f in range(len(out)) if not out[f] and into[f]), key=gap.__getitem__)
    moves = sorted((f for f in range(len(out)) if out[f] and into[f] and gap[f] > STILL_M), key=lambda f: -gap[f])
    lifts = sorted((f for f in range(len(out)) if out[f] and not into[f]), key=lambda f: -gap[f])
    phases = [*lands, *moves, *lifts]
    steps = [Step(0.0, duration, 0.0) for _ in out]
    for k, f in enumerate(phases):
        start, stop = duration * k / len(phases), duration * (k + 1) / len(phases)
        steps[f] = Step(start if out[f] else 0.0, stop if into[f] else duration, _lift(gap[f]))
    return steps


def _lift(gap_m: float) -> float:
    return float(min(0.03 + 0.2 * gap_m, 0.12))


def ankle_paths(
    a: TransitionClip,
    at: int,
    b: TransitionClip,
    into: int,
    placement: Placement,
    steps: list[Step],
    t: NDArray[np.float64],
    duration: float,
) -> NDArray[np.float64]:
    """(N, F, 3) metres, world: where the ankles should be at times t (N,) after the frame left."""
    paths = np.empty((len(t), len(a.legs), 3))
    ankles = [leg.ankle for leg in a.legs]
    starts, ends = a.joints[at, ankles], placement.points(b.joints[into, ankles])
    end_rates = placement.vectors(np.stack((b.ankle_velocity[into], b.ankle_acceleration[into])))
    zero = np.zeros(3)
    for f, step in enumerate(steps):
        out, out_speed, out_acceleration = starts[f], a.ankle_velocity[at, f], a.ankle_acceleration[at, f]
        end, end_speed, end_acceleration = ends[f], end_rates[0, f], end_rates[1, f]
        stands_out, stands_in = bool(a.planted[at, f]), bool(b.planted[into, f])
        keys = (
            out + (0.25 * SETTLE_S * out_speed if stands_out else zero),
            zero if stands_out else out_speed,
            zero if stands_out else out_acceleration,
            end - (0.25 * SETTLE_S * end_speed if stands_in else zero),
            zero if stands_in else end_speed,
            zero if stands_in else end_acceleration,
        )
        path = quintic_weights(t - step.lift_s, step.land_s - step.lift_s) @ np.stack(keys)
        settle = min(SETTLE_S, duration / 2)
        if stands_out:
            weights = quintic_weights(t, settle)[:, :3]
            path += weights @ np.stack((out - keys[0], out_speed, out_acceleration))
        if stands_in:
            weights = quintic_weights(t - (duration - settle), settle)[:, 3:]
            path += weights @ np.stack((end - keys[3], end_speed, end_acceleration))
        s = np.clip((t - step.lift_s) / (step.land_s - step.lift_s), 0, 1)
        path[:, 1] += step.height_m * 64 * (s * (1 - s)) ** 3
        paths[:, f] = path
    return paths


def foot_turns(
    a: TransitionClip,
    at: int,
    b: TransitionClip,
    into: int,
    placement: Placement,
    steps: list[Step],
    t: NDArray[np.float64],
    duration: float,
) -> NDArray[np.float64]:
    """(N, F, 4) world rotations of the feet at times t (N,), turning while their ankles are under way."""
    turns = np.empty((len(t), len(a.legs), 4))
    ankles = [leg.ankle for leg in a.legs]
    starts = a.world_rotations[at, ankles]
    turn = logarithm(multiply(inverse(starts), placement.rotations(b.world_rotations[into, ankles])))
    rates = body_to_vector_rate(turn, np.stack((b.foot_velocity[into], b.foot_acceleration[into])))
    for f, step in enumerate(steps):
        keys = (np.zeros(3), a.foot_velocity[at, f], a.foot_acceleration[at, f], turn[f], rates[0, f], rates[1, f])
        stands_out, stands_in = bool(a.planted[at, f]), bool(b.planted[into, f])
        whole = quintic_weights(t - step.lift_s, step.land_s - step.lift_s)
        settle = min(SETTLE_S, duration / 2)
        if stands_out:
            whole[:, 1:3] = quintic_weights(t, settle)[:, 1:3]
        if stands_in:
            whole[:, 4:] = quintic_weights(t - (duration - settle), settle)[:, 4:]
        turns[:, f] = turned_by(starts[f], whole @ np.stack(keys))
    return turns


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
