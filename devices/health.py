"""What some seconds of a device's samples say of it: rate, loss, jitter, noise, clock; and a verdict in words."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from devices.clock_map import ClockMap
from devices.sample import TrackerSample

_STILL_S = 1.0
"""Noise is measured in stretches of this length in which the tracker hardly moved."""
_PARTS = 6
_STILL_M = 0.05
"""A tracker rests when the middles of the parts of such a stretch are within this of each other."""
_MOST_LOST = 0.05
_MOST_JITTER_PERIODS = 0.5
_MOST_NOISE_MM = 5.0
_MOST_DRIFT_PPM = 300.0


@dataclass(frozen=True, slots=True)
class TrackerHealth:
    """Figures of one tracker over the measured time.

    rate_hz: samples a second. lost: share of its samples that had no position or never came. jitter_ms: standard
    deviation of arrival against an even beat. noise_mm: standard deviation of the position about a slow sway while it
    rested, root of the sum over axes; None where it never rested for a second. drift_ppm: how much slower its device's
    clock is than the host's; None without a clock or in less than six seconds.
    """

    tracker: str
    samples: int
    rate_hz: float
    lost: float
    jitter_ms: float
    noise_mm: float | None
    drift_ppm: float | None
    quality: float | None
    verdict: str

    def figures(self) -> dict[str, object]:
        """All of it by name, for JSON."""
        return asdict(self)


def diagnose(samples: Sequence[TrackerSample], expected_hz: float, missed: int = 0) -> list[TrackerHealth]:
    """The health of every tracker in a device's samples, sorted by its name.

    expected_hz: samples a second that the device should give of each. missed: samples of all trackers that running
    numbers say were lost on the way.
    """
    by_tracker: dict[str, list[TrackerSample]] = defaultdict(list)
    for sample in samples:
        by_tracker[sample.tracker].append(sample)
    return [_health(tracker, own, expected_hz, missed / len(by_tracker)) for tracker, own in sorted(by_tracker.items())]


def _health(tracker: str, samples: list[TrackerSample], expected_hz: float, missed: float) -> TrackerHealth:
    times = np.array([s.host_time_ns for s in samples]) * 1e-9
    span = float(times[-1] - times[0])
    placed = [s for s in samples if s.position is not None]
    figures = {
        "rate_hz": (len(samples) - 1) / span if span > 0 else 0.0,
        "lost": 1.0 - len(placed) / (len(samples) + missed),
        "jitter_ms": _jitter_s(times) * 1000,
        "noise_mm": _noise_mm(placed),
        "drift_ppm": _drift_ppm(samples),
    }
    qualities = [s.quality for s in samples if s.quality is not None]
    quality = float(np.mean(qualities)) if qualities else None
    verdict = _verdict(expected_hz, **figures)
    return TrackerHealth(tracker, len(samples), **figures, quality=quality, verdict=verdict)


def _jitter_s(times: NDArray[np.float64]) -> float:
    """How far arrivals are from the straight line through them."""
    if len(times) < 3:
        return 0.0
    count = np.arange(len(times))
    return float(np.std(times - np.polyval(np.polyfit(count, times, 1), count)))


def _noise_mm(samples: list[TrackerSample]) -> float | None:
    times = np.array([s.host_time_ns for s in samples]) * 1e-9
    positions = np.array([s.position for s in samples])
    spreads = []
    starts = np.searchsorted(times, times - _STILL_S)
    # Ten looks a second are enough, and each stretch must be a whole one.
    for end in range(0, len(times), max(1, len(times) // 400)):
        start = starts[end]
        if times[end] - times[0] < _STILL_S or end - start < 10:
            continue
        stretch = positions[start : end + 1]
        parts = np.array([part.mean(0) for part in np.array_split(stretch, _PARTS)])
        if np.ptp(parts, axis=0).max() < _STILL_M:
            spreads.append(float(np.sqrt((_swayless(stretch) ** 2).mean(0).sum())))
    # Of all restful stretches a quiet one: the least of them would flatter.
    return float(np.percentile(spreads, 25)) * 1000 if spreads else None


def _swayless(stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) what a slow sway, a parabola, leaves: nobody who wears a tracker is as still as a table."""
    at = np.linspace(-1, 1, len(stretch))
    powers = at[:, None] ** [0, 1, 2]
    return stretch - powers @ np.linalg.lstsq(powers, stretch, rcond=None)[0]


def _drift_ppm(samples: list[TrackerSample]) -> float | None:
    clocked = [(s.device_time_s, s.host_time_ns) for s in samples if s.device_time_s is not None]
    if len(clocked) < 2 or clocked[-1][1] - clocked[0][1] < 6_000_000_000:
        return None
    clock = ClockMap()
    for device_time_s, host_time_ns in clocked:
        clock.host_ns(device_time_s, host_time_ns)
    return clock.drift * 1e6


def _verdict(
    expected_hz: float, *, rate_hz: float, lost: float, jitter_ms: float, noise_mm: float | None,
    drift_ppm: float | None,
) -> str:  # fmt: skip
    """One line a person understands: what is wrong and what to try, or `good`."""
    faults = []
    if rate_hz < 0.8 * expected_hz:
        faults.append(f"only {rate_hz:.0f} of {expected_hz:.0f} samples a second: check baud rate and cable")
    if lost > _MOST_LOST:
        faults.append(f"not seen {lost:.0%} of the time: check its range, sight and battery")
    if jitter_ms > 1000 * _MOST_JITTER_PERIODS / expected_hz:
        faults.append(f"arrives unevenly (±{jitter_ms:.0f} ms): use another USB port or its low-latency setting")
    if noise_mm is not None and noise_mm > _MOST_NOISE_MM:
        faults.append(f"trembles by {noise_mm:.1f} mm at rest: keep metal away, or smooth it")
    if drift_ppm is not None and abs(drift_ppm) > _MOST_DRIFT_PPM:
        faults.append(f"its clock is off by {drift_ppm:.0f} ppm: it is corrected for")
    return "; ".join(faults) or "good"
