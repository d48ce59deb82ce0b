"""How a session or a replay is doing, as rows of a table for the corner of the picture."""

import time
from collections import deque
from collections.abc import Callable, Mapping

import numpy as np

from capture.latency import PERCENTILES
from capture.scene import STANDING_COLOURS, Badge
from capture.standings import Standing, Standings
from devices.sample import ROLES

_REFRESH_S = 0.25
_WORDS = {
    Standing.MEASURED: "measured",
    Standing.EXTRAPOLATED: "extrapolated",
    Standing.PRIOR: "prior",
    Standing.HELD: "held",
    Standing.LOST: "lost",
}


def latency_rows(summary: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Stages with their percentiles, milliseconds, from a `LatencyRecorder.summary`."""
    if not summary:
        return []
    columns = [f"p{p}" for p in PERCENTILES]
    heading = "\t".join(["milliseconds", *columns])
    return [heading, *("\t".join([name, *(f"{row[c]:.1f}" for c in columns)]) for name, row in summary.items())]


def tracker_rows(standings: Standings) -> list[str]:
    """Each tracker that is worn: how it stands now, how often it was missing, and for how long."""
    rows = [
        "\t".join((role.replace("_", " "), _WORDS[Standing(int(now))], str(int(count)), f"{missing:.1f} s"))
        for role, now, count, missing in zip(ROLES, standings.now, standings.dropouts, standings.missing_s, strict=True)
        if now != Standing.ABSENT
    ]
    return ["tracker\tnow\tdropouts\tmissing", *rows] if rows else []


def joined(*parts: list[str]) -> tuple[str, ...]:
    """Tables one under the other, an empty row between."""
    rows: list[str] = []
    for part in parts:
        rows += ["", *part] if rows and part else part
    return tuple(rows)


def standing_legend(standings: Standings) -> tuple[Badge, ...]:
    """The colours of trackers: all of them once one is not measured; before, only what is seen."""
    seen = {Standing(int(now)) for now in standings.now} - {Standing.ABSENT}
    shown = seen if seen <= {Standing.MEASURED} else _WORDS
    return tuple(Badge(STANDING_COLOURS[standing], _WORDS[standing]) for standing in shown)


class Rate:
    """How often something happens, over the last `window_s` seconds."""

    def __init__(self, window_s: float = 2.0) -> None:
        self._window_s = window_s
        self._counts: deque[tuple[float, int]] = deque()

    def per_second(self, count: int) -> float:
        """count: how often it has happened by now, ever."""
        now = time.monotonic()
        self._counts.append((now, count))
        while now - self._counts[0][0] > self._window_s and len(self._counts) > 2:
            self._counts.popleft()
        (first_s, first), (last_s, last) = self._counts[0], self._counts[-1]
        return (last - first) / (last_s - first_s) if last_s > first_s else 0.0


class Refreshed:
    """Rows that are worked out four times a second, however often they are drawn."""

    def __init__(self, make: Callable[[], tuple[str, ...]]) -> None:
        self._make, self._rows, self._due_s = make, (), -np.inf

    def rows(self) -> tuple[str, ...]:
        """The newest."""
        now = time.monotonic()
        if now >= self._due_s:
            self._rows, self._due_s = self._make(), now + _REFRESH_S
        return self._rows
