"""What of the solver can be chosen."""

from dataclasses import dataclass, field

from reconstruction.default_predictor import NeighbourSettings
from reconstruction.local_model import LocalModelSettings

METHODS = ("default", "paper")


@dataclass(frozen=True)
class SolverSettings:
    """How a frame is solved.

    method: "default", or "paper" for the reconstruction paper to the letter (`paper_predictor`).
    tracker_sigma_m: metres, least standard deviation of a measured position, above 0.
    noise_gain: the measured noise of the trackers counts this many times as their standard deviation, 0 or more.
    hold_after_s: seconds without any tracker after which the pose is held.
    relocalise: whether to look for the way back (`relocalisation`).
    orientations: whether orientations of trackers are used where there are any.
    orientation_sigma: radians, standard deviation of a measured orientation, above 0.
    neighbours: how they are chosen, in the default method.
    local: how they become a Gaussian, in the default method.
    """

    method: str = "default"
    tracker_sigma_m: float = 0.002
    noise_gain: float = 5.0
    orientations: bool = True
    orientation_sigma: float = 0.03
    hold_after_s: float = 0.5
    relocalise: bool = True
    neighbours: NeighbourSettings = field(default_factory=NeighbourSettings)
    local: LocalModelSettings = field(default_factory=LocalModelSettings)
