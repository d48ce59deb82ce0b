"""Which kind of motion a clip is: the paper's section 3, on the spot, in the plane, or with flight.

The paper's ground is XOY; here it is XOZ, with Y up.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray


class MotionClass(Enum):
    """The paper's three parts of an animation set."""

    ON_THE_SPOT = "on the spot"
    PLANE = "plane motion"
    FLIGHT = "space flight"


@dataclass(frozen=True, slots=True)
class ClassThresholds:
    """Where the classes part, in metres and seconds.

    spot_m: how far apart the places of one foot may lie on the ground for a motion on the spot.
    lift_m, flight_s: both feet at least so high for so long, and
    hip_rise_m: the hips meanwhile so far above where they started, is flight. Running leaves the ground for about
        0.1 s and hardly lifts the hips: it stays plane motion, as the paper has it.
    """

    spot_m: float = 0.55
    lift_m: float = 0.05
    flight_s: float = 0.28
    hip_rise_m: float = 0.12


DEFAULT_THRESHOLDS = ClassThresholds()


def classify(
    feet: NDArray[np.float64],
    clearance: NDArray[np.float64],
    hip_height: NDArray[np.float64],
    fps: float,
    thresholds: ClassThresholds = DEFAULT_THRESHOLDS,
) -> MotionClass:
    """The class of a clip.

    feet: (T, F, 3) metres, world positions of the ankles; clearance: (T, F) metres between each foot's lowest point and
    the floor; hip_height: (T,) metres.
    """
    rise = hip_height - hip_height[0]
    for start, stop in runs(clearance.min(axis=1) > thresholds.lift_m):
        if (stop - start) / fps >= thresholds.flight_s and rise[start:stop].max() > thresholds.hip_rise_m:
            return MotionClass.FLIGHT
    spread = np.linalg.norm(np.ptp(feet[:, :, [0, 2]], axis=0), axis=-1)
    return MotionClass.ON_THE_SPOT if spread.max() < thresholds.spot_m else MotionClass.PLANE


def runs(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(start, stop) of each unbroken run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], true, [False])).astype(np.int8)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]
