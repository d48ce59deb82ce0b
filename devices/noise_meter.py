"""How much a tracker trembles while it rests, measured while it is read.

The fourth difference of evenly spaced readings leaves of noise a variance of 70 sigma squared (the sum of squares of
1, 4, 6, 4, 1) and of slow movement next to nothing. Of the stretches in which the tracker hardly went anywhere, the
quieter ones count (the lower quartile of the newest sixty): what rests is quietest, and everybody rests at times.
"""

import math
from collections import deque
from collections.abc import Iterable
from itertools import pairwise

from devices.axes import Vector
from devices.sample import SampleFlag, TrackerSample

_WINDOW_S = 0.5
_LEAST_READINGS = 16
_STRETCHES = 60
_LEAST_STRETCHES = 3
_PARTS = 4
_STILL_M = 0.01
"""The middles of neighbouring parts of a stretch are nearer to each other than this, or it was no rest."""
_GAP_S = 0.25
_GAIN = math.sqrt(70.0)


class NoiseMeter:
    """Measures one tracker."""

    def __init__(self) -> None:
        self._window: list[Vector] = []
        self._began_s = self._last_s = -math.inf
        self._quiet: deque[float] = deque(maxlen=_STRETCHES)

    @property
    def sigma_m(self) -> float | None:
        """Standard deviation of a coordinate at rest, metres; None before some stretches of rest."""
        return sorted(self._quiet)[len(self._quiet) // 4] if len(self._quiet) >= _LEAST_STRETCHES else None

    def add(self, time_s: float, position: Vector) -> None:
        """One more reading; a pause begins a new stretch."""
        if time_s - self._last_s > _GAP_S:
            self._window.clear()
        if not self._window:
            self._began_s = time_s
        self._last_s = time_s
        self._window.append(position)
        if time_s - self._began_s >= _WINDOW_S and len(self._window) >= _LEAST_READINGS:
            self._measure()
            self._window.clear()

    def _measure(self) -> None:
        points = self._window
        middles = [_middle(points[i * len(points) // _PARTS : (i + 1) * len(points) // _PARTS]) for i in range(_PARTS)]
        if any(math.dist(a, b) > _STILL_M for a, b in pairwise(middles)):
            return
        squares = sum(
            (a[axis] - 4 * b[axis] + 6 * c[axis] - 4 * d[axis] + e[axis]) ** 2
            for a, b, c, d, e in zip(points, points[1:], points[2:], points[3:], points[4:], strict=False)
            for axis in range(3)
        )
        self._quiet.append(math.sqrt(squares / (3 * (len(points) - 4))) / _GAIN)


def trembling(samples: Iterable[TrackerSample], above_mm: float) -> list[str]:
    """The trackers whose noise at rest is measured above that, in the order of their names."""
    meters: dict[str, NoiseMeter] = {}
    for sample in samples:
        if sample.position is not None and not sample.flags & SampleFlag.HELD:
            meters.setdefault(sample.tracker, NoiseMeter()).add(sample.host_time_ns * 1e-9, sample.position)
    return sorted(name for name, meter in meters.items() if (meter.sigma_m or 0.0) * 1000 > above_mm)


def _middle(points: list[Vector]) -> Vector:
    x, y, z = (sum(axis) / len(points) for axis in zip(*points, strict=True))
    return x, y, z
