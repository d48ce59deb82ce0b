"""What the solver gives: a frame, and a take."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from devices.frame import frozen
from reconstruction.motion import Motion, Pose
from reconstruction.skeleton import Skeleton

_NONE = frozen(np.empty(0, np.int64))
_WORLD = frozen(np.zeros(3))
"""The heading frame that stands at the world's origin."""


@dataclass(frozen=True, eq=False)
class Solution:
    """One solved frame.

    sigma: (J,) radians, standard deviation of each joint's rotation, calibrated: it grows with how far the solution
        is from what the neighbours expected and with the time since trackers were measured; 0 for joints that never
        turn.
    coverage: distance to the neighbours over the database's own spacing: about 1 inside the data, more outside.
    states: (6,) int8 of `Footing`: what each role's place stands on.
    stage_ns: nanoseconds by stage.
    neighbours: (K,) database rows that the prior came of, none while the pose is held; the row before each stands in
        the heading frame `heading` (3,), the last pose's.
    """

    pose: Pose
    sigma: NDArray[np.float64]
    coverage: float
    states: NDArray[np.int8]
    stage_ns: dict[str, int]
    neighbours: NDArray[np.int64] = field(default_factory=lambda: _NONE)
    heading: NDArray[np.float64] = field(default_factory=lambda: _WORLD)


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A whole take, solved. motion: one pose a frame; sigma: (T, J) radians; coverage: (T,); states: (T, 6) of
    `Footing`; milliseconds: (T,) a frame; neighbours, headings: T arrays (K,) and (T, 3), as in `Solution`."""

    motion: Motion
    sigma: NDArray[np.float64]
    coverage: NDArray[np.float64]
    states: NDArray[np.int8]
    milliseconds: NDArray[np.float64]
    neighbours: tuple[NDArray[np.int32], ...] = ()
    headings: NDArray[np.float64] = field(default_factory=lambda: _WORLD[None])

    @classmethod
    def of(
        cls, solutions: Sequence[Solution], skeleton: Skeleton, fps: float, name: str = "reconstruction"
    ) -> "Reconstruction":
        """Solutions of frames that followed each other."""
        motion = Motion(
            skeleton,
            frozen(np.array([s.pose.root_position for s in solutions])),
            frozen(np.array([s.pose.rotations for s in solutions])),
            fps,
            name,
        )
        return cls(
            motion,
            frozen(np.array([s.sigma for s in solutions])),
            frozen(np.array([s.coverage for s in solutions])),
            frozen(np.array([s.states for s in solutions])),
            frozen(np.array([sum(s.stage_ns.values()) / 1e6 for s in solutions])),
            tuple(s.neighbours.astype(np.int32) for s in solutions),
            frozen(np.array([s.heading for s in solutions])),
        )
