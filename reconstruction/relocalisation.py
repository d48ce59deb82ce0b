"""The way back: noticing that another part of the database explains the last half second of trackers far better.

With few trackers the history can talk itself into a pose that the trackers do not belong to, a wrong facing most of
all. So the whole database is searched for the recent way of the trackers, a slice a frame, again and again; what is
found is compared with how well the present pose's own neighbours explain the same way.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.tracker_matching import Matches, Sighting, TrackerMatcher, best_by_direction

OFFSETS = np.array([0, -6, -12, -20, -30])
"""Frames: the moments of the last half second that are compared."""


class TrackerHistory:
    """Where the trackers were over the last half second."""

    def __init__(self) -> None:
        self._positions: deque[NDArray[np.float64]] = deque(maxlen=int(1 - OFFSETS.min()))
        self.frames = 0
        """How many were ever taken in."""

    def __len__(self) -> int:
        return len(self._positions)

    def add(self, positions: NDArray[np.float64]) -> None:
        """Takes in positions (6, 3) metres, world, NaN where missing."""
        self._positions.append(positions)
        self.frames += 1

    def sighting(self) -> Sighting:
        """The moments of `OFFSETS` that are there."""
        offsets = OFFSETS[len(self._positions) > -OFFSETS]
        return Sighting(offsets, np.array([self._positions[offset - 1] for offset in offsets]))


@dataclass(frozen=True, eq=False)
class Finding:
    """What a pass over the database found.

    sighting: the trackers' way up to now, in the database's scale; best: what of the database fits it best;
    facings: the best for each direction that the body may face, best first.
    """

    sighting: Sighting
    best: Matches
    facings: tuple[Matches, ...]

    CLEARLY = 0.5
    """What is found must fit this much better, as a ratio of root mean square errors, ..."""
    BADLY_M = 0.03
    """... and what is believed must be at least so many metres off."""

    def beats(self, own_error: float) -> bool:
        """Whether it explains the trackers clearly better than what is off by so many metres."""
        return own_error > self.BADLY_M and self.best.errors[0] < self.CLEARLY * own_error


class Relocaliser:
    """Searches the database for the trackers' way, `ROWS_A_FRAME` rows with each call."""

    ROWS_A_FRAME = 500
    MOST_ROWS = 20_000
    """Rows looked at in one pass: every so many-th of a large database, so that a pass takes 40 frames at most."""
    KEEP = 64
    AROUND = 3
    """Frames around a found row, and around its sequel, that are looked at when the pass is over."""

    def __init__(self, matcher: TrackerMatcher):
        self._matcher = matcher
        self._stride = max(1, len(matcher) // self.MOST_ROWS)
        self._rows = np.arange(0, len(matcher), self._stride)
        self.reset()

    def reset(self) -> None:
        """Begins a new pass with the next call."""
        self._asked: Sighting | None = None
        self._fits = np.full((2, len(self._rows)), np.inf)
        self._done, self._asked_at = 0, 0

    def look(self, history: TrackerHistory, scale: float) -> Finding | None:
        """Goes on searching; at the end of a pass, what was found, if anything."""
        now = history.sighting()
        now = Sighting(now.offsets, now.points / scale)
        if self._asked is None:
            if len(now.offsets) < len(OFFSETS):
                return None
            self._asked, self._asked_at = now, history.frames
        part = slice(self._done, self._done + self.ROWS_A_FRAME)
        self._fits[:, part] = self._matcher.fits(self._asked, self._rows[part])
        self._done += self.ROWS_A_FRAME
        if self._done < len(self._rows):
            return None
        found = self._conclude(now, history.frames - self._asked_at)
        self.reset()
        return found

    def _conclude(self, now: Sighting, age: int) -> Finding | None:
        """The best sequels, `age` frames on, of the pass's best rows, matched against where the trackers are by now."""
        squares, yaw = self._fits
        count = min(self.KEEP, len(squares))
        best = self._sequel(now, self._rows[np.argpartition(squares, count - 1)[:count]] + age)
        if not len(best.rows):
            return None
        facings = [self._sequel(now, self._rows[[place]] + age) for place in best_by_direction(squares, yaw)]
        facings = sorted((match for match in facings if len(match.rows)), key=lambda match: match.errors[0])
        return Finding(now, best, tuple(facings))

    def _sequel(self, now: Sighting, rows: NDArray[np.int64]) -> Matches:
        rows = self._matcher.around(rows, self.AROUND + self._stride // 2)
        return self._matcher.best(now, rows, self.KEEP)
