"""The whole library: which actions, how many, on which bodies; and the demo's show."""

import zlib

import numpy as np

from devices.progress import Progress, no_progress
from reconstruction.motion import Motion
from reconstruction.motion_library import actions
from reconstruction.motion_library.actions import Part, play
from reconstruction.motion_library.gestures import Blow, box, golf_swing, look_around, wave
from reconstruction.motion_library.leap import Leap
from reconstruction.motion_library.script import Script
from reconstruction.motion_operations import mirrored

LIBRARY_VERSION = "1"
"""Changes whenever the motions do: cached databases carry it in their name."""

STATURES = (1.58, 1.68, 1.75, 1.82, 1.92)
"""Metres: about the 5th percentile of women to the 95th of men in the ANSUR II survey (2012)."""

_CLIPS = {"walk": 46, "run": 28, "jump": 20, "punch": 18, "golf": 16, "idle": 14, "turn": 16, "sidestep": 6}
_LEFT_HANDED = 0.25


def generate_library(seed: int = 0, progress: Progress = no_progress) -> list[Motion]:
    """The clips, about 85,000 poses at 60 Hz, named `<action>_<stature cm>_<number>`; the same seed gives the same."""
    planned = [(action, number) for action, count in _CLIPS.items() for number in range(count)]
    motions = []
    for done, (action, number) in enumerate(planned, 1):
        rng = np.random.default_rng([seed, zlib.crc32(action.encode()), number])
        stature = float(STATURES[number % len(STATURES)] + rng.uniform(-0.03, 0.03))
        motion = play(getattr(actions, action)(rng), stature, rng, f"{action}_{100 * stature:.0f}_{number:02d}")
        motions.append(mirrored(motion) if rng.random() < _LEFT_HANDED else motion)
        progress(done, len(planned))
    return motions


def demo_motion() -> Motion:
    """A show of half a minute that is not in the library: wave, walk, turn, jog, jump, box, swing a club."""
    jump = Leap(15.6, 0.30, 0.24)
    blows = [Blow(19.3, 0), Blow(19.75, 1), Blow(20.6, 0), Blow(21.0, 0), Blow(21.4, 1), Blow(21.85, 0, hook=0.9)]
    show = Script(
        30.0,
        forward=(
            (0, 0), (4.0, 0), (4.8, 1.25), (7.2, 1.3), (8.6, 1.35), (9.4, 2.9), (12.6, 3.1), (13.4, 1.5), (14.3, 0),
            (jump.take_off - 0.22, 0), (jump.take_off - 0.03, 0.9), (jump.landing, 0.9),
            (jump.landing + 0.25, 0), (30, 0),
        ),
        turning=((0, 0), (5.4, 0), (6.2, 0.75), (8.2, 0.75), (9.0, 0.0), (9.8, 0.6), (12.2, 0.6), (13, 0), (30, 0)),
        width=((0, 0.10), (17.6, 0.10), (18.1, 0.15), (22.8, 0.15), (23.3, 0.23), (30, 0.23)),
        stagger=((0, 0), (17.6, 0), (18.1, 0.18), (22.8, 0.18), (23.3, 0), (30, 0)),
        sink=((0, 0), (17.9, 0), (18.6, 0.02), (22.8, 0.02), (23.5, 0), (30, 0)),
        steps=((4.0, 14.35), (17.7, 18.7), (22.9, 24.0)),
        leaps=(jump,),
    )  # fmt: skip
    rng = np.random.default_rng(20261122)
    gestures = (
        lambda p: look_around(p, rng),
        lambda p: wave(p, 0.3, 3.8, 1, 1.9),
        lambda p: box(p, 18.2, 22.9, blows),
        lambda p: golf_swing(p, 24.2, 1.3, 0.95),
    )
    return play(Part(show, "relaxed", gestures), 1.78, rng, "demo")
