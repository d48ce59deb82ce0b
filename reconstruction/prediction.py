"""What every method says before it looks at the likelihood: the prior of the next pose, and what it comes from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from reconstruction.map_problem import GaussianPrior
from reconstruction.tracker_matching import Sighting


@dataclass(frozen=True, eq=False)
class SolvedPose:
    """q: (D,) seen from its own heading frame; heading: (3,) that frame; joints: (J, 3) metres, seen from it;
    arms: (6, 3) metres, from the tracked joints to where their trackers sit, seen from it;
    role_rotations: (6, 4) of the tracked joints, world."""

    q: NDArray[np.float64]
    heading: NDArray[np.float64]
    joints: NDArray[np.float64]
    arms: NDArray[np.float64]
    role_rotations: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Prediction:
    """prior: of the next pose, seen from the last pose's heading frame; rows: (K,) int64, the database rows it comes
    from, being like the next pose; coverage: their distance over the database's own spacing."""

    prior: GaussianPrior
    rows: NDArray[np.int64]
    coverage: float


class Predictor(Protocol):
    """A method's prior p(q_t | Q_{t,m}), and, where it looks at them, c_t."""

    def predict(
        self, past: Sequence[SolvedPose], trackers: NDArray[np.float64], way: Sighting | None = None
    ) -> Prediction:
        """From the last poses, the latest at the end, and tracked joints (6, 3) metres seen from its heading frame.

        Joints whose tracker is missing stand where they would go on to. way: where trackers were up to half a second
        before the last pose, seen from its heading frame, in the database's scale; given where they are few.
        """
        ...
