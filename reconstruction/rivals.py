"""Other beliefs, tried beside the present one while the solver is lost: a queue, and one on trial at a time."""

from collections import deque
from collections.abc import Callable

import numpy as np

from reconstruction.belief import Belief
from reconstruction.relocalisation import Finding, TrackerHistory
from reconstruction.rotations import wrapped
from reconstruction.tracker_matching import Matches, Sighting, TrackerMatcher


class Rivals:
    """Facings that the body might have instead, each tried for `Belief.TRIAL` frames."""

    OTHERWISE_RAD = 0.5
    """Least difference of facing: a smaller one the solver finds by itself."""
    MOST = 4
    """So many are tried in a row, the best matches first."""
    PAUSE = 600
    """Frames after all were tried in vain before others are looked for; twice as many each time, ..."""
    LONGEST_PAUSE = 3600
    """... up to so many: what has no better explanation now will hardly have one soon."""

    def __init__(self, matcher: TrackerMatcher):
        self._matcher = matcher
        self.reset()

    def reset(self) -> None:
        """Forgets all of them."""
        self._waiting: deque[int] = deque()
        self._since = 0
        self._rival: Belief | None = None
        self._pause, self._resting = self.PAUSE, 0

    @property
    def wanted(self) -> bool:
        """Whether others should be looked for: none is on trial, none waits, and those before are long dismissed."""
        return self._rival is None and not self._waiting and self._resting <= 0

    def propose(self, found: Finding, facing: float) -> None:
        """Takes in what was found, but for what faces as the present belief does: `facing`, radians."""
        others = [m for m in found.facings if abs(wrapped(m.heading[2] - facing)) > self.OTHERWISE_RAD]
        self._waiting = deque(int(match.rows[0]) for match in others[: self.MOST])
        self._since = 0

    def rival(self, history: TrackerHistory, scale: float, believe: Callable[[Matches], Belief]) -> Belief | None:
        """The one on trial, if any: the next that waits, from where the trackers are by now, if there was none."""
        self._since += 1
        self._resting -= 1
        while self._rival is None and self._waiting:
            seen = history.sighting()
            row = self._waiting.popleft() + self._since
            match = self._matcher.best(Sighting(seen.offsets, seen.points / scale), np.array([row]), 1)
            if len(match.rows):
                self._rival = believe(match)
        return self._rival

    def judged(self, rival: Belief, limit: float) -> Belief | None:
        """The one on trial if its trial is over and its cost below the limit; where it is above, it is dismissed."""
        if rival.age < Belief.TRIAL:
            return None
        self._rival = None
        if rival.cost < limit:
            return rival
        if not self._waiting:
            self._resting, self._pause = self._pause, min(2 * self._pause, self.LONGEST_PAUSE)
        return None
