"""Fetching poses of a database as they are seen from another pose's heading frame."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


def gather(
    rows: NDArray[np.int64], back: int, poses: NDArray[np.float32], headings: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Poses (K, D) of the rows `back` before `rows`, seen from the heading frames one row before `rows`."""
    out = np.empty((len(rows), poses.shape[1]))
    gather_kernel(rows, back, poses, headings, out)
    return out


@njit(cache=True)
def gather_kernel(rows, back, poses, headings, out):
    """See `gather`. The root's turn is exp(y yaw) exp(w), composed as quaternions."""
    for k in range(len(rows)):
        row, frame = rows[k] - back, rows[k] - 1
        for d in range(out.shape[1]):
            out[k, d] = poses[row, d]
        if row == frame:
            continue
        see_from(out[k], headings[row], headings[frame])


@njit(cache=True)
def see_from(q, own, other):
    """Changes q (D,), seen from heading frame `own` (3,), to what it is seen from `other` (3,), in place."""
    cosine, sine = np.cos(other[2]), np.sin(other[2])
    dx, dz = own[0] - other[0], own[1] - other[1]
    yaw = own[2] - other[2]
    c, s = np.cos(yaw), np.sin(yaw)
    x, z = q[0], q[2]
    q[0] = c * x + s * z + cosine * dx - sine * dz
    q[2] = c * z - s * x + sine * dx + cosine * dz
    a, b, e = q[3], q[4], q[5]
    angle = np.sqrt(a * a + b * b + e * e)
    scale = 0.5 if angle < 1e-9 else np.sin(angle / 2) / angle
    a, b, e, w = a * scale, b * scale, e * scale, np.cos(angle / 2)
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    a, b, e, w = c * a + s * e, c * b + s * w, c * e - s * a, c * w - s * b
    if w < 0:
        a, b, e, w = -a, -b, -e, -w
    sine = np.sqrt(a * a + b * b + e * e)
    scale = 2.0 if sine < 1e-9 else 2 * np.arctan2(sine, w) / sine
    q[3], q[4], q[5] = a * scale, b * scale, e * scale
