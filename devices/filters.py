"""Smoothing and outlier rejection of one tracker's readings.

One-Euro filter: Casiez, Roussel and Vogel, "1 Euro Filter: A Simple Speed-based Low-pass Filter for Noisy Input in
Interactive Systems", CHI 2012: a low-pass filter whose cut-off grows with speed, so that it smooths what rests and
does not delay what moves. Here the speed is that of the point (and of the turn), not of each coordinate.
"""

import math
from dataclasses import dataclass

from devices.axes import Quaternion, Vector
from devices.errors import SettingError
from devices.sample import SampleFlag, TrackerSample
from devices.track import slerp

_BATCH_S = 0.02
"""Readings that a USB adapter hands over together seem to be of one moment, and are of up to this long."""


@dataclass(frozen=True, slots=True)
class OneEuroSettings:
    """min_cutoff_hz: cut-off at rest. beta: hertz more of cut-off for each m/s (for turns: each rad/s).

    speed_cutoff_hz: cut-off of the speed estimate. on: whether anything is done at all. noise_above_mm: done only for a
    tracker whose noise at rest is measured above this many millimetres, 0 for always. Raises SettingError where a value
    is out of range.
    """

    min_cutoff_hz: float = 4.0
    beta: float = 60.0
    speed_cutoff_hz: float = 5.0
    on: bool = True
    noise_above_mm: float = 0.0

    def __post_init__(self) -> None:
        if not (self.min_cutoff_hz > 0 and self.beta >= 0 and self.speed_cutoff_hz > 0 and self.noise_above_mm >= 0):
            raise SettingError("One-Euro: cut-offs must be above 0 Hz, beta and the least noise at least 0")


@dataclass(frozen=True, slots=True)
class GateSettings:
    """max_speed_m_s: a faster jump is an outlier, unless `accept_after` readings in a row agree on the new place.

    min_quality: readings below it are dropped (0 to 1). Readings that the device itself calls suspect always are.
    on: whether anything is done at all.
    """

    max_speed_m_s: float = 25.0
    accept_after: int = 5
    min_quality: float = 0.05
    on: bool = True

    def __post_init__(self) -> None:
        if not (self.max_speed_m_s > 0 and self.accept_after >= 1 and 0 <= self.min_quality <= 1):
            raise SettingError("gate: speed above 0 m/s, at least 1 reading, and a quality of 0 to 1")


def smoothing_factor(cutoff_hz: float, period_s: float) -> float:
    """The share of the new value in a first-order low-pass step (their eq. for alpha): 1 / (1 + tau / T_e)."""
    tau = 1.0 / (2 * math.pi * cutoff_hz)
    return 1.0 / (1.0 + tau / period_s)


class OneEuroFilter:
    """Filters one tracker. `settings` may be replaced at any time."""

    def __init__(self, settings: OneEuroSettings) -> None:
        self.settings = settings
        self._time_s = -math.inf
        self._position: Vector = (0.0, 0.0, 0.0)
        self._velocity: Vector = (0.0, 0.0, 0.0)
        self._orientation: Quaternion | None = None
        self._turning = 0.0

    def __call__(
        self, time_s: float, position: Vector, orientation: Quaternion | None
    ) -> tuple[Vector, Quaternion | None]:
        """The smoothed position (metres) and orientation; a pause of half a second starts it anew."""
        period = time_s - self._time_s
        if period <= 0:
            return self._position, self._orientation
        self._time_s = time_s
        if period > 0.5:
            self._position, self._velocity, self._turning = position, (0.0, 0.0, 0.0), 0.0
            self._orientation = orientation
            return position, orientation
        calm = smoothing_factor(self.settings.speed_cutoff_hz, period)
        self._position = self._moved(position, period, calm)
        self._orientation = self._turned(orientation, period, calm) if orientation else None
        return self._position, self._orientation

    def _moved(self, new: Vector, period: float, calm: float) -> Vector:
        x, y, z = self._position
        dx, dy, dz = new[0] - x, new[1] - y, new[2] - z
        u, v, w = self._velocity
        self._velocity = u, v, w = (
            u + calm * (dx / period - u),
            v + calm * (dy / period - v),
            w + calm * (dz / period - w),
        )
        speed = math.sqrt(u * u + v * v + w * w)
        share = smoothing_factor(self.settings.min_cutoff_hz + self.settings.beta * speed, period)
        return (x + share * dx, y + share * dy, z + share * dz)

    def _turned(self, new: Quaternion, period: float, calm: float) -> Quaternion:
        old = self._orientation
        if old is None:
            return new
        alike = min(1.0, abs(sum(a * b for a, b in zip(old, new, strict=True))))
        self._turning += calm * (2 * math.acos(alike) / period - self._turning)
        share = smoothing_factor(self.settings.min_cutoff_hz + self.settings.beta * self._turning, period)
        return slerp(old, new, share)


class OutlierGate:
    """Tells the readings of one tracker that can be believed from those that cannot. `settings` may be replaced."""

    def __init__(self, settings: GateSettings) -> None:
        self.settings = settings
        self.rejected = 0
        self._good: tuple[float, Vector] | None = None
        self._doubtful: tuple[float, Vector] | None = None
        self._agreeing = 0

    def __call__(self, time_s: float, sample: TrackerSample) -> bool:
        """Whether the sample, which has a position, is to be used."""
        position = sample.position
        quality_is_low = sample.quality is not None and sample.quality < self.settings.min_quality
        if position is None or quality_is_low or sample.flags & SampleFlag.SUSPECT:
            self.rejected += 1
            return False
        if self._good is None or self._near(self._good, time_s, position):
            self._good, self._agreeing = (time_s, position), 0
            return True
        steady = self._doubtful is not None and self._near(self._doubtful, time_s, position)
        self._agreeing = self._agreeing + 1 if steady else 1
        self._doubtful = (time_s, position)
        if self._agreeing >= self.settings.accept_after:
            self._good, self._agreeing = (time_s, position), 0
            return True
        self.rejected += 1
        return False

    def _near(self, last: tuple[float, Vector], time_s: float, position: Vector) -> bool:
        return math.dist(last[1], position) <= self.settings.max_speed_m_s * max(time_s - last[0], _BATCH_S)


def measured_lag_s(settings: OneEuroSettings, speed_m_s: float, rate_hz: float) -> float:
    """How far behind the filter is on a tracker that moves steadily, seconds: found by running it for two seconds."""
    filtered = OneEuroFilter(settings)
    lag_s = 0.0
    for tick in range(round(2 * rate_hz)):
        time_s = tick / rate_hz
        smoothed, _ = filtered(time_s, (time_s * speed_m_s, 0.0, 0.0), None)
        lag_s = time_s - smoothed[0] / speed_m_s
    return lag_s
