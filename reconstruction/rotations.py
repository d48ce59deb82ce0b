"""Rotations as batched NumPy arrays: quaternions (x, y, z, w), rotation vectors, means, and the turn about up.

The few operations that SciPy's `Rotation` does not give on arrays of any shape, or gives too slowly for a database.
"""

import numpy as np
from numpy.typing import NDArray


def multiply(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Hamilton product of quaternions (..., 4): first `b`, then `a`."""
    ax, ay, az, aw = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bx, by, bz, bw = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    product = np.empty(np.broadcast(a, b).shape)
    product[..., 0] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 1] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 2] = aw * bz + ax * by - ay * bx + az * bw
    product[..., 3] = aw * bw - ax * bx - ay * by - az * bz
    return product


def inverse(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of unit quaternions (..., 4)."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def exponential(w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit quaternions (..., 4) of rotation vectors (..., 3) radians."""
    angle = np.linalg.norm(w, axis=-1, keepdims=True)
    return np.concatenate((0.5 * np.sinc(angle / (2 * np.pi)) * w, np.cos(angle / 2)), axis=-1)


def logarithm(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation vectors (..., 3) radians, at most pi long, of unit quaternions (..., 4)."""
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., 3:])
    return q[..., :3] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)


def rotate(q: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (..., 3) turned by unit quaternions (..., 4)."""
    t = 2 * cross(q[..., :3], v)
    return v + q[..., 3:] * t + cross(q[..., :3], t)


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cross product of vectors (..., 3); several times as fast as `np.cross` on small arrays."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty(np.broadcast(a, b).shape)
    product[..., 0] = ay * bz - az * by
    product[..., 1] = az * bx - ax * bz
    product[..., 2] = ax * by - ay * bx
    return product


def about_up(yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternions (..., 4) that turn by `yaw` radians about +Y (from +Z towards +X)."""
    yaw = np.asarray(yaw, np.float64)
    zero = np.zeros_like(yaw)
    return np.stack((zero, np.sin(yaw / 2), zero, np.cos(yaw / 2)), axis=-1)


def twist_about_up(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle (...,) radians of the turn about +Y in the swing-twist decomposition of unit quaternions (..., 4)."""
    return wrapped(2 * np.arctan2(q[..., 1], q[..., 3]))


def wrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same angles in [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def outer_sum(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum over the first axis of q q^T, (..., 4, 4), of quaternions (T, ..., 4): what `mean_of_sum` takes."""
    return np.einsum("t...a,t...b->...ab", q, q)


def mean_of_sum(outer: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean quaternions (..., 4) with w >= 0 from sums (..., 4, 4) of q q^T: the leading eigenvectors.

    Markley, Cheng, Crassidis, Oshman, "Averaging Quaternions", 2007, eq. 12-13.
    """
    mean = np.linalg.eigh(outer)[1][..., -1]
    return np.where(mean[..., 3:] < 0, -mean, mean)
