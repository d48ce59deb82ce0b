"""The actions of the library, each a script with gestures, drawn anew from a random generator: no two are alike."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from reconstruction.motion import Motion
from reconstruction.motion_library.gestures import Blow, box, crouch, golf_swing, look_around, shift_weight, wave
from reconstruction.motion_library.leap import Leap, leap, without_gait
from reconstruction.motion_library.locomotion import carry_pelvis, carry_trunk, plan_gait, swing_arms, swing_legs
from reconstruction.motion_library.performance import Performance, bake
from reconstruction.motion_library.script import LEAD, Keys, Script
from reconstruction.motion_library.styles import STYLES, personal
from reconstruction.standard_body import standard_skeleton

Gesture = Callable[[Performance], object]


@dataclass(frozen=True)
class Part:
    """One clip to be played: what the body does, how, and what its arms and trunk do besides."""

    script: Script
    style: str = "neutral"
    gestures: tuple[Gesture, ...] = field(default=())


def play(part: Part, stature: float, rng: Generator, name: str) -> Motion:
    """The motion of a part on the standard body of that stature (metres)."""
    style = personal(STYLES[part.style], rng)
    course = part.script.course(stature)
    p = Performance(standard_skeleton(stature), course.times)
    planned = plan_gait(course, style, stature, first_foot=int(rng.integers(2)))
    for jump in part.script.leaps:
        planned = without_gait(planned, course.times, jump)
    carry_pelvis(p, course, planned, style)
    swing_legs(p, planned, style)
    carry_trunk(p, planned, style, rng)
    swing_arms(p, planned, style, rng)
    for jump in part.script.leaps:
        leap(p, planned, jump)
    for gesture in part.gestures:
        gesture(p)
    return bake(p, name, LEAD, -LEAD)


def walk(rng: Generator) -> Part:
    """Standing, walking off at 0.5 to 1.9 m/s with a bend or two, stopping; or walking all through."""
    speed, seconds = float(rng.uniform(0.5, 1.9)), float(rng.uniform(8, 12))
    turning = _bends(rng, seconds, 0.9 / (0.4 + speed))
    style = str(rng.choice(list(STYLES), p=_often_neutral()))
    return Part(Script(seconds, forward=_go(rng, speed, seconds), turning=turning), style, (_looking(rng),))


def run(rng: Generator) -> Part:
    """Walking up to a run of 2.4 to 5 m/s, and down again."""
    speed, seconds = float(rng.uniform(2.4, 5.0)), float(rng.uniform(7, 10))
    style = str(rng.choice(["neutral", "relaxed", "happy", "tired", "proud", "angry"]))
    return Part(
        Script(seconds, forward=_go(rng, speed, seconds, 1.6), turning=_bends(rng, seconds, 0.7 / speed)), style
    )


def turn(rng: Generator) -> Part:
    """Turning on the spot, a quarter to a whole turn, to one side and perhaps back."""
    seconds = float(rng.uniform(7, 10))
    keys: list[tuple[float, float]] = [(0.0, 0.0)]
    at = float(rng.uniform(0.6, 1.2))
    while at < seconds - 3.0:
        rate, last = float(rng.choice([-1, 1]) * rng.uniform(0.9, 2.4)), float(rng.uniform(0.9, 1.8))
        keys += [(at, 0.0), (at + 0.35, rate), (at + 0.35 + last, rate), (at + 0.7 + last, 0.0)]
        at += 1.4 + last + float(rng.uniform(0, 1))
    return Part(Script(seconds, turning=keys), str(rng.choice(list(STYLES), p=_often_neutral())))


def sidestep(rng: Generator) -> Part:
    """Steps to one side and back."""
    seconds, speed = 8.0, float(rng.uniform(0.35, 0.7) * rng.choice([-1, 1]))
    keys = [
        (0.0, 0.0),
        (0.8, 0.0),
        (1.2, speed),
        (3.0, speed),
        (3.5, 0.0),
        (4.3, 0.0),
        (4.8, -speed),
        (6.6, -speed),
        (7.1, 0),
    ]
    return Part(Script(seconds, aside=keys))


def idle(rng: Generator) -> Part:
    """Standing: weight from foot to foot, looking around, at times a wave or a squat."""
    seconds = float(rng.uniform(9, 13))
    gestures: list[Gesture] = [lambda p: shift_weight(p, rng), lambda p: look_around(p, rng)]
    if rng.random() < 0.6:
        start, side, hertz = float(rng.uniform(1, 3)), int(rng.integers(2)), float(rng.uniform(1.4, 2.4))
        gestures.append(lambda p: wave(p, start, start + float(rng.uniform(3.0, 4.5)), side, hertz))
    if rng.random() < 0.4:
        down, depth = float(rng.uniform(6.0, 6.6)), float(rng.uniform(0.08, 0.24))
        gestures.append(lambda p: crouch(p, down, down + 2.4, depth))
    stance: Keys = ((0.0, float(rng.uniform(0.08, 0.16))),)
    script = Script(seconds, width=stance, stagger=((0.0, float(rng.uniform(-0.06, 0.06))),))
    return Part(script, str(rng.choice(list(STYLES), p=_often_neutral())), tuple(gestures))


def jump(rng: Generator) -> Part:
    """Two or three jumps, up or forward, from standing."""
    leaps, keys = [], [(0.0, 0.0)]
    at = float(rng.uniform(0.5, 0.9))
    for _ in range(int(rng.integers(2, 4))):
        one = Leap(at, float(rng.uniform(0.12, 0.38)), float(rng.uniform(0.16, 0.30)))
        reach = float(rng.uniform(0.0, 0.9)) * (rng.random() < 0.6)
        rate = reach / (one.landing - one.take_off)
        keys += [(one.take_off - 0.22, 0.0), (one.take_off - 0.03, rate), (one.landing + 0.02, rate)]
        keys += [(one.landing + 0.25, 0.0)]
        leaps.append(one)
        at = one.end + float(rng.uniform(0.1, 0.6))
    never = ((0.0, 0.0),)
    return Part(Script(at + 0.5, forward=keys, leaps=tuple(leaps), steps=never), str(rng.choice(["neutral", "happy"])))


def punch(rng: Generator) -> Part:
    """A boxer's stance, then singles and combinations of jabs, crosses and hooks."""
    seconds = float(rng.uniform(8, 11))
    blows, at = [], 1.9
    while at < seconds - 1.6:
        for number in range(int(rng.integers(1, 4))):
            hook = float(rng.uniform(0.7, 1.0)) if rng.random() < 0.25 else 0.0
            blows.append(Blow(at, (number + int(rng.random() < 0.25)) % 2, hook, float(rng.uniform(-0.12, 0.06))))
            at += float(rng.uniform(0.34, 0.55))
        at += float(rng.uniform(0.3, 0.9))
    stance = Script(
        seconds,
        width=((0.0, 0.11), (0.3, 0.11), (0.7, 0.15)),
        stagger=((0.0, 0.0), (0.3, 0.0), (0.7, float(rng.uniform(0.14, 0.22)))),
        sink=((0.0, 0.0), (0.5, 0.0), (1.2, 0.02)),
        steps=((0.4, 1.3),),
    )
    return Part(stance, "neutral", (lambda p: box(p, 0.8, seconds - 0.2, blows),))


def golf(rng: Generator) -> Part:
    """One golf swing after the feet are set."""
    tempo = float(rng.uniform(0.85, 1.12))
    start = float(rng.uniform(1.4, 1.9))
    width = float(rng.uniform(0.20, 0.27))
    script = Script(
        start + 1.2 + 2.5 / tempo + 1.0, width=((0.0, 0.11), (0.3, 0.11), (0.8, width)), steps=((0.4, 1.3),)
    )
    return Part(script, "neutral", (lambda p: golf_swing(p, start, 1.2, tempo),))


def _go(rng: Generator, speed: float, seconds: float, gather: float = 0.8) -> Keys:
    """Speed keys: from standing or already going, to standing or still going."""
    keys: list[tuple[float, float]] = []
    if rng.random() < 0.6:
        begin = float(rng.uniform(0.5, 1.0))
        keys += [(0.0, 0.0), (begin, 0.0), (begin + gather, speed)]
    else:
        keys += [(0.0, speed)]
    middle = 0.5 * seconds
    keys += [(middle, speed * float(rng.uniform(0.85, 1.1)))]
    if rng.random() < 0.6:
        keys += [(seconds - 0.9 - 1.5 * gather, speed), (seconds - 0.9, 0.0), (seconds, 0.0)]
    return keys


def _bends(rng: Generator, seconds: float, most: float) -> Keys:
    """Turn-rate keys, rad/s: straight on for a while, then bends."""
    rates = np.where(rng.random(4) < 0.45, 0.0, rng.uniform(-most, most, 4))
    keys = [(0.0, 0.0), (1.6, 0.0)]
    keys += [(2.3 + (seconds - 4.6) * k / 3, float(rate)) for k, rate in enumerate(rates)]
    return [*keys, (seconds - 1.6, 0.0)]


def _looking(rng: Generator) -> Gesture:
    return (lambda p: look_around(p, rng)) if rng.random() < 0.3 else (lambda _: None)


def _often_neutral() -> list[float]:
    others = len(STYLES) - 1
    return [0.3 if name == "neutral" else 0.7 / others for name in STYLES]
