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

    def __init__(self, matcher: TrackerMatcher):
        self._matcher = matcher
        self.reset()

    def reset(self) -> None:
        """Forgets all of them."""
        self._waiting: deque[int] = deque()
        self._since = 0
        self._rival: Belief | None = None

    @property
    def waiting(self) -> bool:
        """Whether any is on trial or waits for its own."""
        return self._rival is not None or bool(self._waiting)

    def propose(self, found: Finding, facing: float) -> None:
        """Takes in what was found, but for what faces as the present belief does: `facing`, radians."""
        others = [m for m in found.facings if abs(wrapped(m.heading[2] - facing)) > self.OTHERWISE_RAD]
        self._waiting = deque(int(match.rows[0]) for match in others)
        self._since = 0

    def rival(self, history: TrackerHistory, scale: float, believe: Callable[[Matches], Belief]) -> Belief | None:
        """The one on trial, if any: the next that waits, from where the trackers are by now, if there was none."""
        self._since += 1
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
        return rival if rival.cost < limit else None
