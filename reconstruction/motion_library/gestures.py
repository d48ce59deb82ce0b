"""What arms and trunk do over a performance: wave, guard and punch, swing a golf club, look around, shift weight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.motion_library.axes import about_y, turned
from reconstruction.motion_library.easing import bump, keyed, ramp, smooth_step, wander, window
from reconstruction.motion_library.performance import Performance

Array = NDArray[np.float64]


def wave(p: Performance, start: float, end: float, side: int, hertz: float = 1.8) -> None:
    """The hand goes up beside the head and waves from the elbow."""
    weight = window(p.times, start + 0.5, end - 0.5, 0.5)
    sign = 1 - 2 * side
    swing = np.sin(2 * np.pi * hertz * (p.times - start)) * window(p.times, start + 0.6, end - 0.6, 0.3)
    stature = p.stature
    _reach(p, side, weight, [sign * (0.20 * stature + 0.07 * swing), 0.055 * stature, 0.12 * stature], outward=0.8)
    p.pronate[:, side] += weight * np.radians(35)
    p.head_turn += weight * sign * np.radians(8)
    p.spine_side -= weight * sign * np.radians(3)


def look_around(p: Performance, rng: np.random.Generator) -> None:
    """The head turns here and there, the chest a little with it."""
    turn = np.radians(22) * wander(rng, p.times, 1.0, 0.25)
    p.head_turn += turn
    p.spine_turn += 0.15 * turn
    p.head_nod += np.radians(5) * wander(rng, p.times, 1.0, 0.3)


def shift_weight(p: Performance, rng: np.random.Generator, sway_m: float = 0.028) -> None:
    """The pelvis over one foot, then over the other, with the slow sway of standing (Winter 1995)."""
    sway = sway_m * np.tanh(1.6 * wander(rng, p.times, 1.0, 0.16))
    left = turned(about_y(p.pelvis_turn), np.array([1.0, 0.0, 0.0]))
    forward = turned(about_y(p.pelvis_turn), np.array([0.0, 0.0, 1.0]))
    p.pelvis_position += sway[:, None] * left + (0.008 * wander(rng, p.times, 1.0, 0.4))[:, None] * forward
    p.pelvis_list += 1.6 * sway
    p.spine_side -= 1.5 * sway
    p.pelvis_position[:, 1] -= 0.12 * np.abs(sway)


@dataclass(frozen=True)
class Blow:
    """One punch. at: seconds of the hit; side: 0 left, 1 right; hook: 0 straight to 1 round; high: metres over chin."""

    at: float
    side: int
    hook: float = 0.0
    high: float = 0.0


_OUT_S, _BACK_S = 0.17, 0.30
"""Seconds to the hit and back: jabs and crosses take 0.30 to 0.48 s in all (Whiting, Gregor and Finerman 1988)."""


def box(p: Performance, start: float, end: float, blows: list[Blow]) -> None:
    """Hands up in guard from `start` to `end`, and out with each blow, the trunk turning into it."""
    guard = window(p.times, start + 0.45, end - 0.45, 0.45)
    stature, bounce = p.stature, guard * 0.007 * np.sin(2 * np.pi * 2.1 * p.times)
    p.pelvis_position[:, 1] -= 0.012 * stature * guard - bounce
    p.spine_lean += guard * np.radians(9)
    p.head_nod += guard * np.radians(6)
    for side in range(2):
        sign = 1 - 2 * side
        out = np.zeros(len(p.times))
        place = np.tile([sign * 0.085, -0.035, 0.19], (len(p.times), 1)) * stature
        for blow in blows:
            if blow.side == side:
                drive = _drive(p.times, blow.at)
                out = np.maximum(out, drive)
                place += drive[:, None] * (_hit(blow, sign, stature) - place)
                round_way = bump(np.clip((p.times - blow.at + _OUT_S) / (_OUT_S + _BACK_S), 0, 1))
                place[:, 0] += blow.hook * sign * 0.16 * stature * round_way
        p.spine_turn -= sign * out * np.radians(26 if side else 16)
        p.pelvis_turn -= sign * out * np.radians(16 if side else 7)
        p.shoulder_raise[:, side] += out * np.radians(8)
        _reach(p, side, guard, place, outward=0.35 + 0.5 * out)
        p.pronate[:, side] += guard * np.radians(20) + out * np.radians(45)


def _drive(times: Array, hit: float) -> Array:
    """(T,) 0 in guard, 1 at the hit: out faster than back."""
    return np.where(
        times <= hit, smooth_step((times - hit + _OUT_S) / _OUT_S), smooth_step((hit + _BACK_S - times) / _BACK_S)
    )


def _hit(blow: Blow, sign: int, stature: float) -> Array:
    """(3,) metres from the shoulders' middle, in the body's heading: where the fist lands."""
    straight = np.array([-0.03 * sign, 0.02, 0.37]) * stature
    hooked = np.array([-0.06 * sign, 0.02, 0.26]) * stature
    return straight + blow.hook * (hooked - straight) + [0, blow.high, 0]


_GOLF_KEYS: tuple[tuple[float, float, float, float, float], ...] = (
    # seconds, hands about the swing plane, pelvis, chest against pelvis (degrees, left positive), weight to the left
    (0.00, 0, 0, 0, 0.0), (0.30, -42, -12, -12, -0.25), (0.62, -118, -36, -34, -0.5), (0.86, -148, -44, -46, -0.45),
    (0.98, -138, -30, -50, 0.1), (1.08, -86, -4, -42, 0.5), (1.155, -8, 26, -22, 0.7), (1.23, 62, 46, -2, 0.8),
    (1.42, 128, 74, 18, 0.95), (1.80, 158, 88, 26, 1.0), (2.50, 154, 86, 24, 1.0),
)  # fmt: skip
"""Backswing about 0.86 s, downswing about 0.28 s, pelvis 45 and thorax 90 degrees back at the top, pelvis ahead of the
thorax at impact: Hume, Keogh and Reid (2005), McTeigue et al. (1994), rounded."""

GOLF_SECONDS = _GOLF_KEYS[-1][0]


def golf_swing(p: Performance, start: float, settle_s: float = 1.2, tempo: float = 1.0) -> float:
    """Bends to the ball for `settle_s`, swings a club right-handed towards the body's left, holds; returns the end, s.

    The hands run round a circle in the swing plane, tilted about 52 degrees, as the double-pendulum model of Cochran
    and Stobbs (1968) has them.
    """
    keys = np.array(_GOLF_KEYS)
    swing_start = start + settle_s
    at = np.concatenate([[start], swing_start + keys[:, 0] / tempo])
    angle, pelvis, chest, weight = (keyed(p.times, at, np.concatenate([[0.0], keys[:, k]]), 0.022) for k in range(1, 5))
    end = swing_start + GOLF_SECONDS / tempo
    inside = window(p.times, start + 0.6, end + 0.1, 0.6)
    stature = p.stature
    upright = smooth_step((angle - 70) / 90)
    bent = inside * (1 - 0.62 * upright)
    p.pelvis_lean += bent * np.radians(20)
    p.spine_lean += bent * np.radians(20)
    p.head_nod -= bent * np.radians(4)
    p.pelvis_position[:, 1] -= bent * 0.035 * stature
    left = turned(about_y(p.pelvis_turn), np.array([1.0, 0.0, 0.0]))
    back = turned(about_y(p.pelvis_turn), np.array([0.0, 0.0, -1.0]))
    p.pelvis_position += inside[:, None] * (
        0.055 * stature * weight[:, None] * left + 0.045 * stature * (bent[:, None]) * back
    )
    p.pelvis_turn += inside * np.radians(pelvis)
    p.spine_turn += inside * np.radians(chest)
    p.head_turn -= inside * np.radians(0.75 * (pelvis + chest)) * (1 - upright)
    _hands_round_the_plane(p, np.radians(angle), inside, heading=p.pelvis_turn - inside * np.radians(pelvis))
    _trail_heel(p, inside * smooth_step((angle - 10) / 110))
    return end + 0.7


def _hands_round_the_plane(p: Performance, angle: Array, weight: Array, heading: Array) -> None:
    """Both hands, one above the other on the club, at an angle (T,) about the swing plane; 0 is the address."""
    stature = p.stature
    tilt = np.radians(52)
    radius = stature * (0.335 - 0.055 * np.abs(np.sin(angle / 2)) ** 2)
    down, aside = np.array([0.0, -np.sin(tilt), np.cos(tilt)]), np.array([1.0, 0.0, 0.0])
    circle = np.cos(angle)[:, None] * down + np.sin(angle)[:, None] * aside
    chest, _ = p.trunk()["Spine2"]
    body = about_y(heading)
    centre = chest + turned(body, np.array([0.0, 0.055, 0.03]) * stature)
    for side in range(2):
        grip = radius + (0.022 if side else -0.022) * stature
        target = centre + turned(body, grip[:, None] * circle)
        _towards(p, side, weight, target, turned(body, np.array([0.5 * (1 - 2 * side), -1.0, 0.1])))


def _trail_heel(p: Performance, share: Array) -> None:
    """The right heel comes up and turns out as the weight goes to the left foot; the ball of the foot stays."""
    from reconstruction.motion_library.footwork import FootShape

    shape = FootShape.of(p.skeleton)
    pitch, turn = -np.radians(48) * share, np.radians(26) * share
    forward, up = shape.ankle_over(pitch)
    before, after = about_y(p.foot_turn[:, 1]), about_y(p.foot_turn[:, 1] + turn)
    ball = np.array([0.0, 0.0, shape.ball[0]])
    rolled = np.stack([np.zeros_like(forward), np.zeros_like(up), forward - shape.ball[0]], -1)
    p.ankle[:, 1] += turned(before, np.broadcast_to(ball, rolled.shape)) + turned(after, rolled)
    p.ankle[:, 1, 1] += up - shape.height
    p.foot_pitch[:, 1] += pitch
    p.foot_turn[:, 1] += turn
    p.toe_bend[:, 1] += -pitch


def crouch(p: Performance, start: float, end: float, depth: float) -> None:
    """Squats down by `depth` (share of stature) and up again, the trunk leaning forward, arms out for balance."""
    weight = window(p.times, start + 0.7, end - 0.7, 0.7)
    p.pelvis_position[:, 1] -= weight * depth * p.stature
    back = turned(about_y(p.pelvis_turn), np.array([0.0, 0.0, -1.0]))
    p.pelvis_position += (weight * 0.35 * depth * p.stature)[:, None] * back
    p.pelvis_lean += weight * depth * 1.6
    p.spine_lean += weight * depth * 1.4
    p.head_nod -= weight * depth * 1.8
    p.arm_flex += (weight * depth * 4.0)[:, None]


def _reach(p: Performance, side: int, weight: Array, place: object, outward: object) -> None:
    """The hand to a place (3,) or (T, 3) metres from the shoulders' middle, seen in the body's heading."""
    columns = place if isinstance(place, np.ndarray) else np.stack(np.broadcast_arrays(*place), -1)  # type: ignore[misc]
    columns = np.broadcast_to(columns, (len(p.times), 3))
    chest_position, chest = p.trunk()["Spine2"]
    body = about_y(p.pelvis_turn)
    middle = chest_position + turned(chest, np.broadcast_to(np.array([0.0, 0.068 * p.stature, 0.0]), columns.shape))
    sign = 1 - 2 * side
    sideways = np.broadcast_to(np.asarray(outward, float), p.times.shape)
    pole = np.stack([sign * sideways, -np.ones_like(sideways), np.full_like(sideways, -0.2)], -1)
    _towards(p, side, weight, middle + turned(body, columns), turned(body, pole))


def _towards(p: Performance, side: int, weight: Array, target: Array, pole: Array) -> None:
    """Blends a hand target in: where two gestures meet, the later one wins by its weight."""
    share = weight[:, None]
    p.hand_target[:, side] += share * (target - p.hand_target[:, side])
    p.elbow_pole[:, side] += share * (pole - p.elbow_pole[:, side])
    still = p.hand_weight[:, side] < 1e-9
    p.hand_target[still, side] = target[still]
    p.elbow_pole[still, side] = pole[still] if pole.ndim == 2 else pole
    p.hand_weight[:, side] = np.maximum(p.hand_weight[:, side], weight)


def settle(times: Array, at: float, seconds: float = 1.0) -> Array:
    """(T,) 0 before a moment, 1 after it: for what comes in once and stays."""
    return ramp(times, at, at + seconds)
