"""When readings were taken, for a device that does not say: an even beat under the times of their arrival.

A device without a clock still measures evenly. Bytes only ever come late, never early, and a USB adapter hands them
over in batches; so the beat runs along the earliest arrivals: a phase-locked loop (Gardner, "Phaselock Techniques",
second order) that is fed, every half second, the least lateness of the readings since. A reading that is earlier than
the beat pulls the beat to it at once.

Where the device numbers its readings, the numbers say how many were lost on the way. Where it does not, one that is
later than any jitter lately seen stands behind lost ones, or was held up itself, which only the next ones tell; so
times are those of arrival again for some seconds. It is never worse than those for long.
"""

from dataclasses import dataclass, field

_START_S = 1.0
_START_READINGS = 12
_WINDOW_S = 0.5
_WINDOW_READINGS = 12
_PAUSE_S = 1.0
"""After such a silence it begins anew."""
_PHASE_GAIN, _PERIOD_GAIN = 0.5, 0.06
"""Share of the lateness that a window takes back at once and, spread over the next one, in the period: critically
damped (period gain = phase gain squared / 4)."""
_SKIPPED = 0.6
"""Later than the jitter by this share of a period stands behind a lost reading."""
_TRUSTED_AFTER_S = 10.0
"""So long without such a one the beat counts, where readings have no numbers."""
_SLOWEST_S = 0.025
"""Nor does it count there above this period: a lost reading costs more than the jitter of batches."""
_JITTER_FADES = 0.9
_LEAST_JITTER_S = 0.004


@dataclass(slots=True)
class ArrivalClock:
    """Evens out one tracker's arrivals. Pure: the same readings give the same times. period_s: of the beat, 0 at first.

    In the first second, and after a pause, times are those of arrival.
    """

    period_s: float = 0.0
    _start: list[tuple[float, int]] = field(default_factory=list)
    _origin_ns: int = 0
    _number: int | None = None
    _unit: int = 0
    _largest: int = 0
    _beat: float = 0.0
    _arrived: float = 0.0
    _jitter: float = 0.0
    _least: float = 0.0
    _latest: float = 0.0
    _pulled: float = 0.0
    _count: int = 0
    _since: float = 0.0
    _doubtful: float = 0.0
    _last_ns: int = -(2**63)

    def host_ns(self, host_time_ns: int, sequence: int | None = None) -> int:
        """The host time at which a reading was taken, less a constant least delay; later readings get later times.

        host_time_ns: when it arrived. sequence: the device's running number, where it has one.
        """
        if not self._start and not self.period_s:
            self._origin_ns = host_time_ns
        arrived = (host_time_ns - self._origin_ns) * 1e-9
        steps = self._steps(sequence)
        if arrived - self._arrived > _PAUSE_S:
            self._forget(host_time_ns)
            arrived, steps = 0.0, 1
        self._arrived = arrived
        numbered = sequence is not None
        taken = self._followed(arrived, steps, numbered) if self.period_s else self._started(arrived, steps)
        if not numbered and (self.period_s > _SLOWEST_S or arrived - self._doubtful < _TRUSTED_AFTER_S):
            taken = arrived
        self._last_ns = max(self._origin_ns + round(taken * 1e9), self._last_ns + 1)
        return self._last_ns

    def _steps(self, sequence: int | None) -> int:
        """How many readings farther this one is than the last, by their numbers; 1 where there are none."""
        before, self._number = self._number, sequence
        if sequence is None or before is None:
            return 1
        self._largest = max(self._largest, sequence)
        wraps = next(size for size in (1 << 8, 1 << 16, 1 << 32, 1 << 64) if self._largest < size)
        step = (sequence - before) % wraps
        if not self._unit:
            self._unit = max(1, step)
        return max(1, round(step / self._unit)) if step < wraps // 2 else 1

    def _forget(self, host_time_ns: int) -> None:
        self.period_s, self._origin_ns, self._unit = 0.0, host_time_ns, 0
        self._start.clear()

    def _started(self, arrived: float, steps: int) -> float:
        """Collects the first second, and lays the beat under it."""
        number = self._start[-1][1] + steps if self._start else 0
        self._start.append((arrived, number))
        span = arrived - self._start[0][0]
        if span < _START_S or number < _START_READINGS:
            return arrived
        period = _period(self._start)
        late = [at - n * period for at, n in self._start]
        self.period_s, self._beat = period, number * period + min(late)
        self._jitter = max(late) - min(late)
        self._start.clear()
        self._doubtful = arrived
        self._open_window(arrived)
        return self._beat

    def _followed(self, arrived: float, steps: int, numbered: bool) -> float:
        self._beat += steps * self.period_s
        late = arrived - self._beat
        jitter = max(self._jitter, _LEAST_JITTER_S)
        if not numbered and not -_SKIPPED * self.period_s < late < jitter + _SKIPPED * self.period_s:
            late = self._skipped(late, arrived)
        if late < 0:
            self._pulled -= late
            self._beat, late = arrived, 0.0
        self._least, self._latest = min(self._least, late), max(self._latest, late)
        self._count += steps
        taken = self._beat
        if arrived - self._since >= _WINDOW_S and self._count >= _WINDOW_READINGS:
            self._close_window(arrived, numbered)
        return taken

    def _skipped(self, late: float, arrived: float) -> float:
        """Moves the beat by whole periods to where the reading is; what is left of its lateness."""
        self._doubtful = arrived
        whole = round(late / self.period_s) * self.period_s
        self._beat += whole
        return late - whole

    def _open_window(self, arrived: float) -> None:
        self._since, self._count = arrived, 0
        self._least, self._latest, self._pulled = float("inf"), 0.0, 0.0

    def _close_window(self, arrived: float, numbered: bool) -> None:
        """What the window's earliest reading says of phase and period."""
        least = self._least
        if not numbered and least > _SKIPPED * self.period_s:
            least = self._skipped(least, arrived)
        self._beat += _PHASE_GAIN * least
        self.period_s += _PERIOD_GAIN * (least - self._pulled) / self._count
        self._jitter = max(self._latest - self._least, _JITTER_FADES * self._jitter)
        self._open_window(arrived)


def _period(start: list[tuple[float, int]]) -> float:
    """Seconds between readings by (arrival, number) of the first of them.

    By the slope from the earliest of the middle third to the earliest of the last. The first third does not count: what
    piled up before the host began to read came all at once, and would make the beat too fast.
    """
    third = len(start) // 3
    period = (start[-1][0] - start[0][0]) / (start[-1][1] - start[0][1])
    for _ in range(2):
        parts = (start[third : 2 * third], start[2 * third :])
        (early, n), (late, m) = (min((at - number * period, number) for at, number in part) for part in parts)
        period += (late - early) / (m - n)
    return period
