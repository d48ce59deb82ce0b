"""A device's clock on the host's: offset and drift by a robust running fit, the jitter of arrival taken out.

Bytes only ever come late, never early, and a USB adapter hands them over in batches. So of each second only the reading
that came with the least delay counts, and a line through those (Theil 1950, Sen 1968: the median of all slopes) is the
map. What comes early for that line, or far too late for long, or runs back, comes from a clock that was set anew: the
fit restarts.
"""

from collections import deque
from dataclasses import dataclass, field
from itertools import combinations
from statistics import median

BLOCK_S = 1.0
"""The least delayed reading of each stretch of this length counts."""
BLOCKS = 24
"""How many of them the line goes through."""
_SPAN_FOR_DRIFT_S = 5.0
_LARGEST_DRIFT = 1e-3
_BACK_S = 0.5
_EARLY_S = 0.1
_LATE_S = 1.0
_LATE_FOR_S = 0.5


@dataclass(slots=True)
class ClockMap:
    """Maps one device's clock. Pure: the same readings give the same map. restarts: how often it began anew."""

    drift: float = 0.0
    """How much slower the device's clock runs than the host's: host seconds a device second, less one."""
    restarts: int = -1
    _origin: tuple[float, int] = (0.0, 0)
    _offset: float = 0.0
    _offset_at: float = 0.0
    _correction: float = 0.0
    _best: tuple[float, float] = (0.0, 0.0)
    _block_end: float = 0.0
    _blocks: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=BLOCKS))
    _last: tuple[float, int] | None = None
    _late_since: float | None = None

    def host_ns(self, device_time_s: float, host_time_ns: int) -> int:
        """The host time at which a reading was taken, less a constant least delay.

        host_time_ns: when it arrived. Readings in the order of arrival; later device times get no earlier host times.
        """
        if self._last is None:
            self._restart(device_time_s, host_time_ns)
        device = device_time_s - self._origin[0]
        delay = (host_time_ns - self._origin[1]) * 1e-9 - device
        if self._is_another_clock(device, delay - self._predicted(device)):
            self._restart(device_time_s, host_time_ns)
            device = delay = 0.0
        self._learn(device, delay)
        mapped_ns = self._origin[1] + round((device + self._predicted(device)) * 1e9)
        return self._in_order(device, mapped_ns)

    def _predicted(self, device: float) -> float:
        fade = max(0.0, 1.0 - (device - self._offset_at) / BLOCK_S)
        return self._offset + self.drift * (device - self._offset_at) + self._correction * min(1.0, fade)

    def _is_another_clock(self, device: float, lateness: float) -> bool:
        if self._last is not None and device < self._last[0] - _BACK_S:
            return True
        if lateness <= _LATE_S:
            self._late_since = None
            return bool(self._blocks) and lateness < -_EARLY_S
        if self._late_since is None or device < self._late_since:
            self._late_since = device
        return device - self._late_since > _LATE_FOR_S

    def _learn(self, device: float, delay: float) -> None:
        if delay < self._best[1]:
            self._best = (device, delay)
        if not self._blocks:
            # In the first second there is nothing to fit: the least delay so far.
            self._offset = min(self._offset, delay)
        if device >= self._block_end:
            self._blocks.append(self._best)
            self._fit(device)
            self._best, self._block_end = (device, delay), device + BLOCK_S

    def _fit(self, device: float) -> None:
        before = self._predicted(device)
        points = list(self._blocks)
        if points[-1][0] - points[0][0] >= _SPAN_FOR_DRIFT_S:
            slope = median((b - a) / (t - s) for (s, a), (t, b) in combinations(points, 2) if t > s)
            self.drift = max(-_LARGEST_DRIFT, min(_LARGEST_DRIFT, slope))
        self._offset = median(delay + self.drift * (device - at) for at, delay in points)
        self._offset_at = device
        # The step to the new line is spread over a second: time neither jumps nor runs back.
        self._correction = before - self._offset

    def _in_order(self, device: float, mapped_ns: int) -> int:
        if self._last is not None and device >= self._last[0]:
            mapped_ns = max(mapped_ns, self._last[1] + (device > self._last[0]))
        self._last = (device, mapped_ns)
        return mapped_ns

    def _restart(self, device_time_s: float, host_time_ns: int) -> None:
        self.restarts += 1
        earliest = self._last[1] + 1 if self._last else host_time_ns
        self._origin = (device_time_s, host_time_ns)
        self.drift = self._offset = self._offset_at = self._correction = 0.0
        self._best, self._block_end, self._late_since = (0.0, 0.0), BLOCK_S, None
        self._blocks.clear()
        self._last = (0.0, earliest)
