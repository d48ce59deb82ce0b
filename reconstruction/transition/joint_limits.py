"""Joints kept within their limits: the skeleton's own, or else what the two clips show them to do."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from reconstruction.rotations import exponential, logarithm
from reconstruction.transition.crossing import Crossing

LEEWAY_RAD = np.radians(15)
"""How far a joint may come out of its range at the most, ever less willingly: a hard stop would be a jolt."""
OBSERVED_MARGIN_RAD = np.radians(10)
"""What the clips show is not all that a joint can do."""


def limits_of(crossing: Crossing) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(J, 3) lower and upper bounds of the joints' rotation vectors, radians; none for the root.

    The frames left and entered are within them, whatever a skeleton's limits say: captured bodies cross those.
    """
    limits = crossing.a.skeleton.limits
    if limits is None:
        low = np.minimum(crossing.a.rotation_range[0], crossing.b.rotation_range[0]) - OBSERVED_MARGIN_RAD
        high = np.maximum(crossing.a.rotation_range[1], crossing.b.rotation_range[1]) + OBSERVED_MARGIN_RAD
    else:
        ends = logarithm(np.stack((crossing.a.motion.rotations[crossing.at], crossing.entered_rotations)))
        low = np.minimum(limits[..., 0], ends.min(axis=0))
        high = np.maximum(limits[..., 1], ends.max(axis=0))
    low[0], high[0] = -np.inf, np.inf
    return low, high


def kept_within(
    rotations: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Rotations (N, J, 4) whose rotation vectors stay within low and high (J, 3), softly. Plain form of the kernel."""
    vectors = logarithm(rotations)
    inside = np.clip(vectors, low, high)
    over = vectors - inside
    softened = inside + np.sign(over) * LEEWAY_RAD * (1 - np.exp(-np.abs(over) / LEEWAY_RAD))
    return np.where((over == 0).all(axis=-1, keepdims=True), rotations, exponential(softened))


@njit(cache=True)
def keep_within_kernel(rotations, low, high):  # pragma: no cover - compiled
    """`kept_within` in place."""
    vector = np.empty(3)
    for n in range(rotations.shape[0]):
        for j in range(rotations.shape[1]):
            q = rotations[n, j]
            sign = -1.0 if q[3] < 0 else 1.0
            sine = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
            scale = sign * (2.0 if sine < 1e-9 else 2 * np.arctan2(sine, sign * q[3]) / sine)
            outside = False
            for k in range(3):
                value = q[k] * scale
                over = value - min(max(value, low[j, k]), high[j, k])
                if over != 0.0:
                    outside = True
                    side = 1.0 if over > 0 else -1.0
                    value = value - over + side * LEEWAY_RAD * (1 - np.exp(-abs(over) / LEEWAY_RAD))
                vector[k] = value
            if outside:
                angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
                scale = 0.5 if angle < 1e-9 else np.sin(angle / 2) / angle
                for k in range(3):
                    q[k] = vector[k] * scale
                q[3] = np.cos(angle / 2)
