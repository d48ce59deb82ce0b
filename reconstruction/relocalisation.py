"""The way back: noticing that another part of the database explains the last half second of trackers far better.

With few trackers the history can talk itself into a pose that the trackers do not belong to, a wrong facing most of
all. So the whole database is searched for the recent way of the trackers, a slice a frame, again and again; what is
found is compared with how well the present pose's own neighbours explain the same way.
"""

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reconstruction.tracker_matching import Matches, Sighting, TrackerMatcher

OFFSETS = np.array([0, -6, -12, -20, -30])
"""Frames: the moments of the last half second that are compared."""


class TrackerHistory:
    """Where the trackers were over the last half second."""

    def __init__(self) -> None:
        self._positions: deque[NDArray[np.float64]] = deque(maxlen=int(1 - OFFSETS.min()))

    def __len__(self) -> int:
        return len(self._positions)

    def add(self, positions: NDArray[np.float64]) -> None:
        """Takes in positions (6, 3) metres, world, NaN where missing."""
        self._positions.append(positions)

    def sighting(self) -> Sighting:
        """The moments of `OFFSETS` that are there."""
        offsets = OFFSETS[len(self._positions) > -OFFSETS]
        return Sighting(offsets, np.array([self._positions[offset - 1] for offset in offsets]))


class Relocaliser:
    """Searches the database for the trackers' way, `ROWS_A_FRAME` rows with each call."""

    ROWS_A_FRAME = 500
    MOST_ROWS = 20_000
    """Rows looked at in one pass: every so many-th of a large database, so that a pass takes 40 frames at most."""
    KEEP = 64
    AROUND = 3
    """Frames around a found row, and around its sequel, that are looked at when the pass is over."""
    CLEARLY = 0.5
    """What is found must fit this much better, as a ratio of root mean square errors, ..."""
    BADLY_M = 0.03
    """... and what is believed must be at least so many metres off."""

    def __init__(self, matcher: TrackerMatcher):
        self._matcher = matcher
        self._stride = max(1, len(matcher) // self.MOST_ROWS)
        self._rows = np.arange(0, len(matcher), self._stride)
        self.reset()

    def reset(self) -> None:
        """Begins a new pass with the next call."""
        self._asked: Sighting | None = None
        self._squares = np.full(len(self._rows), np.inf)
        self._done, self._age = 0, 0

    def look(self, history: TrackerHistory, scale: float, own_error: Callable[[Sighting], float]) -> Matches | None:
        """Goes on searching; at the end of a pass, what explains the trackers clearly better than the present pose.

        own_error: gives the root mean square distance, metres, of the present explanation from a sighting.
        """
        now = history.sighting()
        now = Sighting(now.offsets, now.points / scale)
        if self._asked is None:
            if len(now.offsets) < len(OFFSETS):
                return None
            self._asked = now
        part = slice(self._done, self._done + self.ROWS_A_FRAME)
        self._squares[part] = self._matcher.squares(self._asked, self._rows[part])
        self._done += self.ROWS_A_FRAME
        if self._done < len(self._rows):
            self._age += 1
            return None
        found = self._conclude(now)
        self.reset()
        if not len(found.rows):
            return None
        own = own_error(now)
        return found if own > self.BADLY_M and found.errors[0] < self.CLEARLY * own else None

    def _conclude(self, now: Sighting) -> Matches:
        """The best sequels of the pass's best rows, matched against where the trackers are by now."""
        count = min(self.KEEP, len(self._squares))
        best = self._rows[np.argpartition(self._squares, count - 1)[:count]]
        rows = self._matcher.around(best + self._age, self.AROUND + self._stride // 2)
        return self._matcher.best(now, rows, self.KEEP)
