"""All trackers at one moment, by role: what the solver is given."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES


class TrackerState(IntEnum):
    """How a role's position in a frame came about."""

    MISSING = 0
    MEASURED = 1
    """A sample at this very time, or between two samples of it."""
    EXTRAPOLATED = 2
    """Carried forward from the last samples."""


@dataclass(frozen=True, slots=True)
class TrackerFrame:
    """The trackers at one moment of host time, one row a role in the order of `ROLES`.

    time_s: seconds on the session's clock.
    positions: (6, 3) metres, world (Y up); NaN where missing.
    orientations: (6, 4) unit quaternions (x, y, z, w), world; NaN where there is none.
    states: (6,) int8 of `TrackerState`.
    """

    time_s: float
    positions: NDArray[np.float64]
    orientations: NDArray[np.float64]
    states: NDArray[np.int8]

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(6,) True where the role has a position."""
        return np.isfinite(self.positions[:, 0])

    @classmethod
    def from_positions(
        cls,
        time_s: float,
        by_role: dict[str, tuple[float, float, float] | NDArray[np.float64]],
        orientations: dict[str, NDArray[np.float64]] | None = None,
    ) -> "TrackerFrame":
        """A frame of measured positions (3,) metres by role; roles not named are missing."""
        positions = np.full((len(ROLES), 3), np.nan)
        quaternions = np.full((len(ROLES), 4), np.nan)
        for role, position in by_role.items():
            positions[ROLES.index(role)] = position
        for role, quaternion in (orientations or {}).items():
            quaternions[ROLES.index(role)] = quaternion
        states = np.where(np.isfinite(positions[:, 0]), TrackerState.MEASURED, TrackerState.MISSING)
        return cls(time_s, frozen(positions), frozen(quaternions), frozen(states.astype(np.int8)))


def frozen(array: NDArray) -> NDArray:
    """The same array, made read-only: what crosses a stage cannot be changed behind its back."""
    array.flags.writeable = False
    return array
