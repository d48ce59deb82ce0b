"""What every method says before it looks at the likelihood: the prior of the next pose, and what it comes from."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES
from reconstruction.map_problem import GaussianPrior
from reconstruction.tracker_matching import Sighting


@dataclass(frozen=True, eq=False)
class SolvedPose:
    """q: (D,) seen from its own heading frame; heading: (3,) that frame; joints: (J, 3) metres, seen from it;
    arms: (6, 3) metres, from the tracked joints to where their trackers sit, seen from it;
    role_turns: (6, 3, 3) rotations of the tracked joints, seen from it."""

    q: NDArray[np.float64]
    heading: NDArray[np.float64]
    joints: NDArray[np.float64]
    arms: NDArray[np.float64]
    role_turns: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Prediction:
    """prior: of the next pose, seen from the last pose's heading frame; rows: (K,) int64, the database rows it comes
    from, being like the next pose; coverage: their distance over the database's own spacing."""

    prior: GaussianPrior
    rows: NDArray[np.int64]
    coverage: float


@dataclass(frozen=True, eq=False)
class Observation:
    """What a predictor may know of this frame, seen from the last pose's heading frame.

    trackers: (6, 3) metres, tracked joints; those whose tracker is missing stand where they would go on to.
    measured: (6,) which of them were.
    way: where few trackers were up to half a second before the last pose, in the database's scale; None where there
        are many, or too little of it is known.
    """

    trackers: NDArray[np.float64]
    measured: NDArray[np.bool_] = field(default_factory=lambda: np.ones(len(ROLES), np.bool_))
    way: Sighting | None = None


class Predictor(Protocol):
    """A method's prior p(q_t | Q_{t,m}), and, where it looks at them, c_t."""

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        """From the last poses, the latest at the end, and what is seen of this one."""
        ...
