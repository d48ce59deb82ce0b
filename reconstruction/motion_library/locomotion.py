"""Standing, walking, running, turning, side-stepping along a course, in any style; feet stay where they are put."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.motion_library import gait_tables as gait
from reconstruction.motion_library.axes import about_y, turned
from reconstruction.motion_library.easing import smooth_step, wander
from reconstruction.motion_library.footwork import FootShape, Plants, ankle_path, foot_turn, swing_of, toe_bend
from reconstruction.motion_library.performance import Performance
from reconstruction.motion_library.styles import Style
from reconstruction.skeleton import Skeleton

Array = NDArray[np.float64]

_DOUBLE_SUPPORT = 0.06
"""Phase at which a walker stands still: the middle of double support, both feet down."""
_UNDER_BODY_WALK, _UNDER_BODY_RUN = 0.245, 0.150
"""Phase at which the hips pass over the planted ankle: touch-down lies about 0.33 leg lengths ahead of the hips."""


@dataclass(frozen=True)
class Course:
    """Where the body goes, T frames: what a choreographer would ask for.

    forward, aside: (T,) m/s along the heading and to the left; turning: (T,) rad/s to the left. width, stagger: (T,)
    metres between the ankles aside, and how far the left ankle stands ahead of the right. sink: (T,) metres the pelvis
    is held lower. steps: (begin, end) seconds in which the feet step; outside they stay. airborne: (take-off, landing)
    seconds of jumps, in which neither foot is planted.
    """

    times: Array
    forward: Array
    aside: Array
    turning: Array
    width: Array
    stagger: Array
    sink: Array
    steps: tuple[tuple[float, float], ...]
    airborne: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Gait:
    """A course with its footfalls decided, (T,) each: stride phase of the left foot, share of running, stance share,
    how far the gait curves are followed (0 standing), and the body's way on the floor (T, 3) with its heading."""

    phase: Array
    running: Array
    stance: Array
    vigour: Array
    speed: Array
    steps_a_second: Array
    ground: Array
    heading: Array
    plants: tuple[Plants, Plants]


def locomotion(skeleton: Skeleton, course: Course, style: Style, rng: np.random.Generator) -> Performance:
    """A performance of the whole body along a course. Feet are planted by `plan_gait`, the rest is published curves."""
    performance = Performance(skeleton, course.times)
    planned = plan_gait(course, style, performance.stature, first_foot=int(rng.integers(2)))
    carry_pelvis(performance, course, planned, style)
    swing_legs(performance, planned, style)
    carry_trunk(performance, planned, style, rng)
    swing_arms(performance, planned, style, rng)
    return performance


def plan_gait(course: Course, style: Style, stature: float, first_foot: int = 0) -> Gait:
    """Cadence, stance and footprints of a course by the published laws; whole steps in every stepping interval."""
    times, step = course.times, course.times[1] - course.times[0]
    speed = np.hypot(course.forward, course.aside)
    heading = np.cumsum(course.turning) * step
    velocity = turned(about_y(heading), np.stack([course.aside, np.zeros_like(speed), course.forward], -1))
    ground = np.cumsum(velocity, axis=0) * step
    threshold = gait.RUN_SPEED * np.sqrt(stature / 1.70)
    running = smooth_step((speed - threshold + 0.2) / 0.4)
    effort = np.maximum(speed + 0.25 * np.abs(course.turning), 0.45)
    cadence = (1 - running) * gait.walking_cadence(effort, stature) + running * gait.running_cadence(speed, stature)
    phase = _whole_steps(times, cadence * style.cadence / 2, course.steps, first_foot)
    stance = (1 - running) * gait.walking_stance(speed) + running * gait.running_stance(speed)
    vigour = smooth_step(course.forward / (0.9 * np.sqrt(stature / 1.70)))
    under = (1 - running) * _UNDER_BODY_WALK + running * _UNDER_BODY_RUN
    plants = tuple(
        _footprints(course, style, side, phase - 0.5 * side, stance, under, ground, heading) for side in range(2)
    )
    return Gait(phase, running, stance, vigour, speed, cadence * style.cadence, ground, heading, (plants[0], plants[1]))


def _whole_steps(
    times: Array, strides_a_second: Array, steps: tuple[tuple[float, float], ...], first_foot: int
) -> Array:
    """(T,) stride phase: it stands still outside the stepping intervals and covers a whole number of steps in each."""
    phase = np.full(len(times), _DOUBLE_SUPPORT + 0.5 * (1 - first_foot))
    step = times[1] - times[0]
    for begin, end in steps:
        inside = (times > begin) & (times <= end)
        natural = float(strides_a_second[inside].sum() * step)
        whole = max(round(2 * natural), 1) / 2
        phase += np.cumsum(np.where(inside, strides_a_second, 0.0)) * step * (whole / max(natural, 1e-9))
    return phase


def _footprints(
    course: Course, style: Style, side: int, phase: Array, stance: Array, under: Array, ground: Array, heading: Array
) -> Plants:
    """The plants of one foot, whose own phase is given: whole phases are its heel strikes."""
    times = course.times
    rising = phase + 1e-7 * (times - times[0])
    numbers = np.arange(np.floor(rising[0]), np.floor(rising[-1]) + 1)
    start = np.interp(numbers, rising, times)
    share = np.interp(start, times, stance)
    end = np.interp(numbers + share, rising, times)
    passing = np.interp(numbers + np.interp(start, times, under), rising, times)
    passing = np.minimum(passing, _end_of_interval(start, course.steps))
    start[0], end[-1] = times[0] - 10.0, times[-1] + 10.0
    start, end, passing = _leave_floor(start, end, passing, course.airborne)
    sign = 1 - 2 * side
    aside, ahead = (
        sign * 0.5 * np.interp(passing, times, course.width),
        sign * 0.5 * np.interp(passing, times, course.stagger),
    )
    turn = np.interp(passing, times, heading)
    ground = np.stack([np.interp(passing, times, ground[:, i]) for i in range(3)], axis=-1)
    offset = np.stack([aside, np.zeros_like(aside), ahead], axis=-1)
    return Plants(start, end, ground + turned(about_y(turn), offset), turn + sign * np.radians(style.flare))


def _end_of_interval(start: Array, steps: tuple[tuple[float, float], ...]) -> Array:
    """(K,) seconds: the end of the stepping interval in which each plant began, or its very start before the first."""
    first = steps[0][0] if steps else 0.0
    ends = np.full(len(start), first)
    for begin, end in steps:
        ends[start > begin + 1e-9] = end
    return ends


def _leave_floor(
    start: Array, end: Array, passing: Array, airborne: tuple[tuple[float, float], ...]
) -> tuple[Array, Array, Array]:
    """Cuts the plants at each jump: up at take-off, a new one at landing where the body then is."""
    for take_off, landing in airborne:
        during = int(np.searchsorted(start, take_off)) - 1
        start = np.insert(start, during + 1, landing)
        end = np.insert(end, during, take_off)
        passing = np.insert(passing, during + 1, landing)
    return start, end, passing


def carry_pelvis(p: Performance, course: Course, planned: Gait, style: Style) -> None:
    """The pelvis over its way: height by `vertical_excursion` or `running_height`, sway, list, rotation."""
    phase, run, vigour = planned.phase, planned.running, planned.vigour
    stature = p.stature
    rise = 0.5 * style.bounce * gait.vertical_excursion(planned.speed, stature) * vigour
    walking = -rise * np.cos(4 * np.pi * (phase - _DOUBLE_SUPPORT)) - 0.008 * stature * vigour - 0.3 * rise
    step_time = 1 / np.maximum(planned.steps_a_second, 1.0)
    hop = gait.running_height(2 * phase, np.minimum(2 * planned.stance, 0.98), step_time)
    runner = hop - 0.018 * stature
    standing = 0.542 * stature - style.sink * stature - course.sink
    sway = (
        0.5
        * style.sway
        * gait.lateral_excursion(planned.speed, stature)
        * smooth_step(planned.speed / 0.5)
        * (1 - 0.75 * run)
    )
    sideways = sway * np.cos(2 * np.pi * (phase - planned.stance / 2))
    left = turned(about_y(planned.heading), np.array([1.0, 0.0, 0.0]))
    p.pelvis_position = planned.ground + sideways[:, None] * left
    p.pelvis_position[:, 1] = standing + (1 - run) * walking + run * runner
    strength = style.pelvis * vigour
    tabled = gait.at_stance(phase, planned.stance, gait.WALK_STANCE)
    p.pelvis_turn = planned.heading + strength * gait.curve("pelvis_rotation", tabled) * (
        0.8 + 0.3 * planned.speed / 1.4
    )
    p.pelvis_list = strength * gait.curve("pelvis_list", tabled)
    p.pelvis_lean = (
        np.radians(0.25 * style.lean) + 0.02 * vigour + 0.06 * run + 0.02 * vigour * np.cos(4 * np.pi * (phase - 0.1))
    )


def swing_legs(p: Performance, planned: Gait, style: Style) -> None:
    """Feet roll and swing by the published angles, and are locked to their plants while on the floor."""
    shape = FootShape.of(p.skeleton)
    hips = p.hips()
    for side in range(2):
        phase = planned.phase - 0.5 * side
        swing = swing_of(planned.plants[side], p.times)
        hip, knee, pitch = _leg_angles(phase, planned, style, swing.share)
        p.foot_pitch[:, side] = pitch
        free = _ankle_by_angles(p, hips[:, side], planned.heading, hip, knee)
        lift = 0.035 * p.stature * (1 + style.knee_lift / 20)
        straight_lift = np.full(len(p.times), lift)
        p.ankle[:, side] = ankle_path(planned.plants[side], p.times, shape, pitch, free, planned.vigour, straight_lift)
        p.foot_turn[:, side] = foot_turn(planned.plants[side], swing)
        p.toe_bend[:, side] = toe_bend(swing, pitch)


def _leg_angles(phase: Array, planned: Gait, style: Style, share: Array) -> tuple[Array, Array, Array]:
    """Hip, knee and foot angles (T,) radians of one leg by the tables, scaled by speed and style."""
    walk = gait.at_stance(phase, planned.stance, gait.WALK_STANCE)
    run = gait.at_stance(phase, planned.stance, gait.RUN_STANCE)
    angles = [
        (1 - planned.running) * gait.curve(f"walk_{name}", walk) + planned.running * gait.curve(f"run_{name}", run)
        for name in ("hip", "knee", "foot")
    ]
    stride = (1 - planned.running) * (0.55 + 0.45 * planned.speed / 1.4) + planned.running * (
        0.7 + 0.3 * planned.speed / 3.2
    )
    lifted = np.radians(style.knee_lift) * np.sin(np.pi * share) ** 2 * (1 - planned.running)
    hip = np.clip(stride, 0, 1.3) * angles[0] * planned.vigour + lifted
    knee = np.clip(stride, 0.7, 1.15) * angles[1] * planned.vigour + 1.3 * lifted
    foot = np.clip(style.foot * stride, 0, 1.1) * angles[2] * planned.vigour
    return hip, knee, foot


def _ankle_by_angles(p: Performance, hip_position: Array, heading: Array, hip: Array, knee: Array) -> Array:
    """(T, 3) metres, world: the ankle under a hip whose thigh and knee have these angles, in the heading's plane."""
    thigh, shin = -p.offset("LeftLeg")[1], -p.offset("LeftFoot")[1]
    forward = thigh * np.sin(hip) + shin * np.sin(hip - knee)
    up = -thigh * np.cos(hip) - shin * np.cos(hip - knee)
    return hip_position + turned(about_y(heading), np.stack([np.zeros_like(up), up, forward], -1))


def carry_trunk(p: Performance, planned: Gait, style: Style, rng: np.random.Generator) -> None:
    """The chest turns and lists against the pelvis, the head stays level and looks where the body goes."""
    vigour, run = planned.vigour, planned.running
    pelvis_turn = p.pelvis_turn - planned.heading
    drift = [np.radians(1.0) * wander(rng, p.times, 1.0) for _ in range(6)]
    p.spine_turn = -pelvis_turn * (1.7 + 0.9 * run) + drift[0]
    p.spine_side = -0.8 * p.pelvis_list + 0.7 * drift[1]
    rocking = np.radians(1.5) * vigour * np.cos(4 * np.pi * (planned.phase - 0.12))
    p.spine_lean = np.radians(0.75 * style.lean) + 0.08 * run + 0.03 * vigour + rocking + drift[2] - p.pelvis_lean * 0.3
    chest_turn = pelvis_turn + p.spine_turn
    turning = np.gradient(planned.heading, p.times)
    look = np.clip(0.18 * turning, -0.5, 0.5)
    p.head_turn = -0.8 * chest_turn + look + style.head_sway * 2.5 * drift[3]
    p.head_nod = (
        np.radians(style.neck) - 0.8 * (p.pelvis_lean + p.spine_lean) + np.radians(3) + style.head_sway * 1.5 * drift[4]
    )
    p.head_tilt = -0.6 * (p.pelvis_list + p.spine_side) + style.head_sway * drift[5]
    _lean_into_turns(p, planned, turning)


def _lean_into_turns(p: Performance, planned: Gait, turning: Array) -> None:
    """Runners and walkers lean inward by the angle whose tangent is v w / g."""
    inward = np.arctan(planned.speed * turning / gait.GRAVITY)
    p.spine_side -= 0.3 * inward
    p.pelvis_list -= 0.5 * inward


def swing_arms(p: Performance, planned: Gait, style: Style, rng: np.random.Generator) -> None:
    """Arms swing against the legs by the published curves and hang at rest, a little bent."""
    run, vigour = planned.running, planned.vigour
    vertical = p.pelvis_lean + p.spine_lean
    for side in range(2):
        phase = planned.phase - 0.5 * side
        swing = (0.45 + 0.55 * planned.speed / 1.4) * style.arm_swing * vigour * (1 - run)
        flex = np.minimum(swing, 2.0) * gait.curve("walk_shoulder", phase)
        flex += (
            run
            * (0.7 + 0.3 * planned.speed / 3.2)
            * gait.curve("run_shoulder", phase)
            * np.clip(style.arm_swing, 0.7, 1.2)
        )
        bend = np.radians(14) + np.minimum(swing, 1.6) * 0.8 * (gait.curve("walk_elbow", phase) - np.radians(10))
        bend = (1 - run) * bend + run * gait.curve("run_elbow", phase)
        slow = [np.radians(1.5) * wander(rng, p.times, 1.0) for _ in range(4)]
        p.arm_flex[:, side] = flex + 0.85 * vertical + np.radians(style.arm_forward + 2) + slow[0]
        p.arm_abduct[:, side] = (
            np.radians(7.5 + style.abduct) + 0.12 * run + 0.04 * vigour + slow[1] + np.radians(style.asymmetry)
        )
        p.arm_twist[:, side] = np.radians(12) + 0.35 * run + 0.5 * slow[2]
        p.elbow[:, side] = np.maximum(bend + np.radians(style.elbow) * (1 - run) + 1.5 * slow[3], np.radians(4))
        p.pronate[:, side] = np.radians(10) - 0.1 * run
        p.wrist[:, side] = np.radians(5) + slow[0]
        p.shoulder_raise[:, side] = np.radians(style.shoulders) + 0.06 * np.maximum(flex, 0)
