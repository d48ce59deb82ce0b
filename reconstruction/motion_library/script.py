"""What is asked of a body over time, as an actor's script: keys of (second, value) that become a `Course`."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from reconstruction.motion_library.easing import keyed
from reconstruction.motion_library.leap import Leap
from reconstruction.motion_library.locomotion import Course

Array = NDArray[np.float64]
Keys = Sequence[tuple[float, float]]

FPS = 60.0
LEAD = 72
"""Frames played before and after each script, and cut away: who walks in has steps behind him."""
STANDING_WIDTH = 0.10
"""Metres between the ankles of a standing person, as a share of stature; walkers set them closer (Murray 1967)."""


@dataclass(frozen=True)
class Script:
    """Keys by channel; a channel holds its last value. Without `steps` the feet step wherever the body moves.

    forward, aside: m/s; turning: rad/s to the left; width, stagger: shares of stature; sink: share of stature.
    """

    seconds: float
    forward: Keys = ((0.0, 0.0),)
    aside: Keys = ((0.0, 0.0),)
    turning: Keys = ((0.0, 0.0),)
    width: Keys = ((0.0, STANDING_WIDTH),)
    stagger: Keys = ((0.0, 0.0),)
    sink: Keys = ((0.0, 0.0),)
    steps: tuple[tuple[float, float], ...] = ()
    leaps: tuple[Leap, ...] = field(default=())

    @property
    def times(self) -> Array:
        """(T,) seconds, `LEAD` frames more than the script at either end."""
        return np.arange(-LEAD, round(self.seconds * FPS) + LEAD) / FPS

    def course(self, stature: float) -> Course:
        """The course of a person of that stature (metres)."""
        times = self.times
        forward, aside, turning = (_channel(times, keys, 0.12) for keys in (self.forward, self.aside, self.turning))
        width, stagger = (stature * _channel(times, keys, 0.05) for keys in (self.width, self.stagger))
        sink = stature * _channel(times, self.sink, 0.10)
        speed = np.hypot(forward, aside)
        narrowing = np.clip(forward / 1.2, 0.0, 1.0) * ~self._jumping(times)
        width = width * (1 - 0.5 * narrowing) * (1 - 0.4 * np.clip((speed - 1.6) / 0.8, 0.0, 1.0))
        for leap in self.leaps:
            sink = sink + leap.sink(times)
        steps = self.steps or _moving(times, speed + 0.3 * np.abs(turning))
        airborne = tuple((leap.take_off, leap.landing) for leap in self.leaps)
        return Course(times, forward, aside, turning, width, stagger, sink, steps, airborne)

    def _jumping(self, times: Array) -> NDArray[np.bool_]:
        return np.any([(times > leap.start) & (times < leap.end) for leap in self.leaps] + [times < 0], axis=0)


def _channel(times: Array, keys: Keys, softness: float) -> Array:
    """(T,) the curve through the keys, its first and last value held."""
    at = np.array([second for second, _ in keys], float)
    values = np.array([value for _, value in keys], float)
    if len(keys) == 1:
        return np.full(len(times), values[0])
    return keyed(times, at, values, softness)


def _moving(times: Array, effort: Array) -> tuple[tuple[float, float], ...]:
    """(begin, end) seconds of the stretches in which the body moves enough to step, longer than a third of a second."""
    moving = np.concatenate([[False], effort > 0.08, [False]])
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    spans = [(float(times[a]), float(times[min(b, len(times) - 1)])) for a, b in edges.reshape(-1, 2)]
    return tuple((begin, end) for begin, end in spans if end - begin > 0.35)
