"""Takes white noise out of the trackers' positions as they come: a Kalman filter with constant acceleration.

A body moves smoothly, noise does not: a position, its velocity and its acceleration are carried on, and each reading
moves them by as much as their uncertainty and the noise say (Kalman 1960; the model with white jerk: Bar-Shalom, Li,
Kirubarajan 2001, section 6.2.3). Movement of constant acceleration comes through without lag; without noise every
reading is taken as it is.
"""

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES


class TrackerFilter:
    """Filters the positions of all trackers, one frame at a time."""

    JERK = 100.0
    """m^2/s^5, the spectral density of white jerk."""
    SPEED_M_S = 2.0
    """Standard deviation of a speed that is not known yet, ..."""
    ACCELERATION_M_S2 = 20.0
    """... and of an acceleration."""

    JUMP = 6.0
    """Standard deviations that a reading may be off; one farther off begins anew."""

    def __init__(self, fps: float):
        t = 1 / fps
        self._transition = np.array([[1, t, t * t / 2], [0, 1, t], [0, 0, 1]])
        powers = [[t**5 / 20, t**4 / 8, t**3 / 6], [t**4 / 8, t**3 / 3, t**2 / 2], [t**3 / 6, t**2 / 2, t]]
        self._driven = self.JERK * np.array(powers)
        self.reset()

    def reset(self) -> None:
        """Forgets all trackers."""
        self._known = np.zeros(len(ROLES), np.bool_)
        self._state = np.zeros((len(ROLES), 3, 3))
        self._covariance = np.zeros((len(ROLES), 3, 3))

    def filtered(self, positions: NDArray[np.float64], noise_m: float) -> NDArray[np.float64]:
        """Positions (6, 3) metres, NaN where missing, without noise of standard deviation noise_m on each axis.

        A tracker that was missing, or is not where it can have come to, starts anew.
        """
        here = np.isfinite(positions[:, 0])
        self._carry_on()
        off = positions - self._state[:, 0]
        deviation = np.sqrt(self._covariance[:, 0, 0] + noise_m**2)
        new = here & (~self._known | (np.abs(off).max(axis=1) > self.JUMP * deviation))
        self._state[new] = 0.0
        self._state[new, 0] = positions[new]
        self._covariance[new] = np.diag([noise_m**2, self.SPEED_M_S**2, self.ACCELERATION_M_S2**2])
        self._known = here
        going_on = here & ~new
        covariance = self._covariance[going_on]
        gain = covariance[:, :, 0] / np.square(deviation[going_on])[:, None]
        self._state[going_on] += gain[:, :, None] * off[going_on, None]
        self._covariance[going_on] -= gain[:, :, None] * covariance[:, None, 0]
        return np.where(here[:, None], self._state[:, 0], np.nan)

    def _carry_on(self) -> None:
        self._state = self._transition @ self._state
        self._covariance = self._transition @ self._covariance @ self._transition.T + self._driven
