"""How the root travels during a transition: the paper's section 5.4, eq. 12 and 13."""

import numpy as np
from numpy.typing import NDArray

GRAVITY = 9.80665
"""m/s^2, standard gravity."""


def with_trend(
    start: NDArray[np.float64], velocity: NDArray[np.float64], acceleration: NDArray[np.float64], t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Eq. 12: p0 + t v + t^2 a / 2, (N, 3) metres; t: (N,) seconds."""
    t = np.asarray(t)[..., None]
    return start + t * velocity + t**2 / 2 * acceleration


def with_gravity(
    start: NDArray[np.float64], velocity: NDArray[np.float64], k_g: float, t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Eq. 13: p0 + t v + k_g t^2 g, (N, 3) metres; a free fall has k_g = 1/2."""
    t = np.asarray(t)[..., None]
    return start + t * velocity + k_g * t**2 * np.array([0.0, -GRAVITY, 0.0])


def gravity_factor(start_height: float, rise_speed: float, end_height: float, duration: float) -> float:
    """k_g of eq. 13 with which the height after `duration` seconds is `end_height`: the flight lands."""
    return float((start_height + duration * rise_speed - end_height) / (GRAVITY * duration**2))


def root_derivatives(
    positions: NDArray[np.float64], frame: int, fps: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocity and acceleration (3,) at a frame of positions (T, 3): of the parabola through it and its neighbours."""
    if len(positions) < 3:
        velocity = (positions[-1] - positions[0]) * fps
        return velocity, np.zeros(3)
    middle = min(max(frame, 1), len(positions) - 2)
    before, here, after = positions[middle - 1 : middle + 2]
    acceleration = (after - 2 * here + before) * fps**2
    return (after - before) / 2 * fps + acceleration * (frame - middle) / fps, acceleration
