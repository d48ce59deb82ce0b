"""Starting from any pose: the trackers alone, matched against every pose of the database.

Only the ground-plane position and the facing of a pose are free, and the best of both has a closed form for any
number of points (a planar Procrustes fit), so that one pass over the database needs no index and serves any subset
of trackers.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class StartMatch:
    """rows: (K,) database rows, best first; errors: (K,) metres, root mean square over the trackers;
    headings: (K, 3) heading frames that lay each row's pose onto the trackers."""

    rows: NDArray[np.int64]
    errors: NDArray[np.float64]
    headings: NDArray[np.float64]


def match_trackers(tracks: NDArray[np.float32], points: NDArray[np.float64], count: int, stride: int = 1) -> StartMatch:
    """The `count` rows of `tracks` (N, 6, 3), every `stride`-th looked at, nearest to points (6, 3) with NaN gaps."""
    roles = np.flatnonzero(np.isfinite(points[:, 0]))
    seen = np.ascontiguousarray(points[roles])
    squares = np.empty((len(tracks) + stride - 1) // stride)
    match_kernel(tracks, stride, roles, seen, squares)
    count = min(count, len(squares))
    best = np.argpartition(squares, count - 1)[:count]
    best = best[np.lexsort((best, squares[best]))]
    rows = best * stride
    headings = np.array([planar_fit(tracks[row][roles].astype(np.float64), seen) for row in rows])
    return StartMatch(rows, np.sqrt(np.maximum(squares[best], 0) / len(roles)), headings)


def planar_fit(model: NDArray[np.float64], seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """x, z metres and yaw radians (3,) that lay points (n, 3) best onto others (n, 3), moving on the floor only."""
    a, b = model - model.mean(axis=0), seen - seen.mean(axis=0)
    along = np.sum(a[:, 0] * b[:, 0] + a[:, 2] * b[:, 2])
    across = np.sum(a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2])
    yaw = np.arctan2(across, along)
    c, s = np.cos(yaw), np.sin(yaw)
    x, z = model.mean(axis=0)[[0, 2]]
    shift = seen.mean(axis=0)[[0, 2]] - np.array([c * x + s * z, c * z - s * x])
    return np.array([shift[0], shift[1], yaw])


@njit(cache=True)
def match_kernel(tracks, stride, roles, seen, squares):
    """Least sum of squared distances, over planar motions, of `seen` (n, 3) to each looked-at row's joints."""
    n = len(roles)
    mx = mz = 0.0
    for i in range(n):
        mx += seen[i, 0] / n
        mz += seen[i, 2] / n
    spread = 0.0
    for i in range(n):
        spread += (seen[i, 0] - mx) ** 2 + (seen[i, 2] - mz) ** 2
    for k in range(len(squares)):
        row = k * stride
        ax = az = 0.0
        for i in range(n):
            ax += tracks[row, roles[i], 0] / n
            az += tracks[row, roles[i], 2] / n
        total, along, across = spread, 0.0, 0.0
        for i in range(n):
            x, z = tracks[row, roles[i], 0] - ax, tracks[row, roles[i], 2] - az
            u, v = seen[i, 0] - mx, seen[i, 2] - mz
            h = tracks[row, roles[i], 1] - seen[i, 1]
            total += x * x + z * z + h * h
            along += x * u + z * v
            across += z * u - x * v
        squares[k] = total - 2 * np.sqrt(along * along + across * across)
