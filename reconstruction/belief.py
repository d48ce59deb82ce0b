"""What the solver believes of the last poses, and whether it may be wrong as a whole.

A body that is thought to face the wrong way can still hold all its trackers: twisted as no body is, far from all
neighbours. So beside the tracker misfit a belief keeps account of how implausible the poses are that it leads to, and
beliefs about the same frames can be compared (in the spirit of multiple hypothesis tracking; Reid 1979).
"""

from collections import deque
from collections.abc import Iterable

import numpy as np

from reconstruction.prediction import SolvedPose
from reconstruction.window_features import SPAN


class Belief:
    """The last poses, the latest at the end, as one explanation of the trackers has them.

    age: frames that were solved from it.
    """

    COUNTED = 5
    """Frames over which its cost is taken."""
    TRIAL = 15
    """Frames after which a belief that began with a pose of the database has come to what it leads to."""

    def __init__(self, past: Iterable[SolvedPose] = ()):
        self.past = deque(past, SPAN)
        self.age = 0
        self._costs: deque[tuple[float, float]] = deque(maxlen=self.COUNTED)

    def add(self, pose: SolvedPose, implausibility: float, energy: float) -> None:
        """Goes on by a pose that was solved from it: how implausible that pose is, and its energy as a solution."""
        self.past.append(pose)
        self._costs.append((implausibility, energy))
        self.age += 1

    @property
    def implausibility(self) -> float:
        """Mean over the last frames; infinite before there are any."""
        return float(np.mean([pose for pose, _ in self._costs])) if self._costs else np.inf

    @property
    def cost(self) -> float:
        """Mean implausibility and energy together, over the last frames; infinite before there are any."""
        return float(np.mean([pose + energy for pose, energy in self._costs])) if self._costs else np.inf
