"""The recent readings of one role, and its place at any moment between them."""

import math
from bisect import bisect_right
from collections import deque
from statistics import median

from devices.axes import Quaternion, Vector
from devices.frame import TrackerState

_INTERVALS = 31
"""Sample intervals that the period is the median of: about half a second at 60 Hz."""
_GAP_PERIODS = 1.75
"""Two samples farther apart than this many periods have lost one between them: nothing is made up there."""
_EDGE_PERIODS = 0.25
"""Beside a gap a sample still stands for moments this near to it."""

Place = tuple[Vector, Quaternion | None, TrackerState]
"""Position in metres, orientation, and how it came about."""


class Track:
    """Readings of one role in time order; `at` interpolates between neighbours and never across a gap.

    shortest_gap_s: neighbours at most this far apart always count as neighbours (one frame period of the solver).
    extrapolate_s: how far past the newest reading a place is carried on at constant velocity.
    """

    def __init__(self, shortest_gap_s: float = 0.0, extrapolate_s: float = 0.0) -> None:
        self._shortest_gap_s = shortest_gap_s
        self._extrapolate_s = extrapolate_s
        self._times: list[float] = []
        self._positions: list[Vector] = []
        self._orientations: list[Quaternion | None] = []
        self._intervals: deque[float] = deque(maxlen=_INTERVALS)
        self._period_s: float | None = None

    def push(self, time_s: float, position: Vector, orientation: Quaternion | None) -> bool:
        """Adds a reading; False, and nothing added, where it is older than the last. One of the same time replaces it:
        without a clock of its own, what comes in one batch has one time, and the last of it is the newest."""
        if self._times and time_s <= self._times[-1]:
            if time_s == self._times[-1]:
                self._positions[-1], self._orientations[-1] = position, orientation
            return time_s == self._times[-1]
        if self._times:
            self._intervals.append(time_s - self._times[-1])
            self._period_s = None
        self._times.append(time_s)
        self._positions.append(position)
        self._orientations.append(orientation)
        return True

    @property
    def period_s(self) -> float:
        """Median seconds between readings; 0 while there are none."""
        if self._period_s is None:
            self._period_s = median(self._intervals) if self._intervals else 0.0
        return self._period_s

    @property
    def newest_s(self) -> float | None:
        """Time of the newest reading; None before the first."""
        return self._times[-1] if self._times else None

    def forget_before(self, time_s: float) -> None:
        """Drops what no later `at(time_s)` can need; the two readings before stay for interpolation and velocity."""
        keep_from = bisect_right(self._times, time_s) - 2
        if keep_from > 0:
            del self._times[:keep_from], self._positions[:keep_from], self._orientations[:keep_from]

    def at(self, time_s: float) -> Place | None:
        """The place at a moment, or None where nothing is known of it."""
        after = bisect_right(self._times, time_s)
        before = after - 1
        if before >= 0 and after < len(self._times):
            gap = self._times[after] - self._times[before]
            if gap <= max(_GAP_PERIODS * self.period_s, self._shortest_gap_s):
                return self._between(before, after, (time_s - self._times[before]) / gap)
        return self._beside(before, after, time_s) or self._beyond(before, time_s)

    def _between(self, before: int, after: int, share: float) -> Place:
        a, b = self._positions[before], self._positions[after]
        position = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]))
        p, q = self._orientations[before], self._orientations[after]
        return position, (slerp(p, q, share) if p and q else p or q), TrackerState.MEASURED

    def _beside(self, before: int, after: int, time_s: float) -> Place | None:
        reach = _EDGE_PERIODS * (self.period_s or self._shortest_gap_s)
        for i in (before, after):
            if 0 <= i < len(self._times) and abs(time_s - self._times[i]) <= reach:
                return self._positions[i], self._orientations[i], TrackerState.MEASURED
        return None

    def _beyond(self, last: int, time_s: float) -> Place | None:
        if not 1 <= last == len(self._times) - 1 or time_s - self._times[last] > self._extrapolate_s:
            return None
        interval = self._times[last] - self._times[last - 1]
        if interval > max(_GAP_PERIODS * self.period_s, self._shortest_gap_s):
            return None
        position, _, _ = self._between(last - 1, last, (time_s - self._times[last - 1]) / interval)
        return position, self._orientations[last], TrackerState.EXTRAPOLATED


def slerp(p: Quaternion, q: Quaternion, share: float) -> Quaternion:
    """The unit quaternion a share of 0 to 1 of the shorter way from p to q (Shoemake 1985)."""
    dot = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    sign = -1.0 if dot < 0 else 1.0
    angle = math.acos(min(1.0, abs(dot)))
    if angle < 1e-4:
        u, v = 1 - share, share * sign
    else:
        u, v = math.sin((1 - share) * angle) / math.sin(angle), sign * math.sin(share * angle) / math.sin(angle)
    mixed = (u * p[0] + v * q[0], u * p[1] + v * q[1], u * p[2] + v * q[2], u * p[3] + v * q[3])
    length = math.sqrt(sum(c * c for c in mixed))
    return (mixed[0] / length, mixed[1] / length, mixed[2] / length, mixed[3] / length)
