"""How each tracker is doing, for whoever looks at the window: where it stands now, and how often it was missing."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from devices.frame import TrackerFrame, frozen
from devices.sample import ROLES
from reconstruction.tracking import Footing


class Standing(IntEnum):
    """What a role's place in the picture stands on; the first four are the solver's `Footing`."""

    MEASURED = Footing.MEASURED
    EXTRAPOLATED = Footing.EXTRAPOLATED
    PRIOR = Footing.PRIOR
    HELD = Footing.HELD
    LOST = 4
    """No sample for so long that somebody should look at it."""
    ABSENT = 5
    """Never seen: nobody wears it."""


LOST_AFTER_S = 2.0


@dataclass(frozen=True, eq=False)
class Standings:
    """All trackers at one moment, in the order of `ROLES`.

    now: (6,) int8 of `Standing`; dropouts: (6,) how often each went missing; missing_s: (6,) seconds without it.
    """

    now: NDArray[np.int8]
    dropouts: NDArray[np.int64]
    missing_s: NDArray[np.float64]


class StandingsWatch:
    """Keeps count over the frames of a session or a take."""

    def __init__(self) -> None:
        count = len(ROLES)
        self._last_seen_s = np.full(count, np.nan)
        self._was_here = np.zeros(count, bool)
        self._dropouts, self._missing_s = np.zeros(count, np.int64), np.zeros(count)
        self._last_s: float | None = None

    def seen(self, frame: TrackerFrame, footing: NDArray[np.integer]) -> Standings:
        """Takes note of one frame. footing: (6,) of `Footing`, as solved."""
        here = frame.measured & (footing == Footing.MEASURED)
        worn = ~np.isnan(self._last_seen_s)
        gone = worn & ~frame.measured
        self._dropouts += gone & self._was_here
        if self._last_s is not None:
            self._missing_s[gone] += max(frame.time_s - self._last_s, 0.0)
        self._was_here, self._last_s = frame.measured.copy(), frame.time_s
        self._last_seen_s[here] = frame.time_s
        now = footing.astype(np.int8)
        now[gone & (frame.time_s - np.nan_to_num(self._last_seen_s) > LOST_AFTER_S)] = Standing.LOST
        now[~worn & ~frame.measured] = Standing.ABSENT
        return Standings(frozen(now), frozen(self._dropouts.copy()), frozen(self._missing_s.copy()))
