"""Which triangle is nearest at each sample of a picture: the z-buffer, as a kernel and as its plain reference."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

TILT = 0.25
"""Samples to shift every second row and column by, so that 2 x 2 samples a pixel stand in four rows and four columns
and nearly upright edges come out as smooth as slanting ones (the rotated grid)."""


@njit("void(f8[:,::1], i4[:,::1], f8, f4[:,::1], i4[:,::1])", cache=True)
def fill_triangles(corners, triangles, tilt, nearness, owner):
    """Draws triangles into a z-buffer, in place.

    corners: (V, 3) sample column, sample row, and nearness (linear across the picture, larger is nearer; a triangle
    with a corner of nearness <= 0 is left out). triangles: (F, 3). nearness, owner: (H, W) the largest nearness so far
    and the triangle it belongs to; start with 0 and -1. Sample (row, column) is at row + 0.5 -+ tilt (an even or odd
    column), column + 0.5 +- tilt (an even or odd row).
    """
    height, width = nearness.shape
    for triangle in range(triangles.shape[0]):
        a, b, c = triangles[triangle]
        ax, ay, aw = corners[a]
        bx, by, bw = corners[b]
        cx, cy, cw = corners[c]
        if aw <= 0.0 or bw <= 0.0 or cw <= 0.0:
            continue
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        first_column = max(int(np.ceil(min(ax, bx, cx) - 0.5 - tilt)), 0)
        last_column = min(int(np.floor(max(ax, bx, cx) - 0.5 + tilt)), width - 1)
        first_row = max(int(np.ceil(min(ay, by, cy) - 0.5 - tilt)), 0)
        last_row = min(int(np.floor(max(ay, by, cy) - 0.5 + tilt)), height - 1)
        share_b_x, share_b_y = (cy - ay) / area, (ax - cx) / area
        share_c_x, share_c_y = (ay - by) / area, (bx - ax) / area
        for row in range(first_row, last_row + 1):
            shift = 0.5 + (tilt if row % 2 == 0 else -tilt) - ax
            for column in range(first_column, last_column + 1):
                x = column + shift
                y = row + 0.5 - (tilt if column % 2 == 0 else -tilt) - ay
                share_b = x * share_b_x + y * share_b_y
                share_c = x * share_c_x + y * share_c_y
                share_a = 1.0 - share_b - share_c
                if share_a < 0.0 or share_b < 0.0 or share_c < 0.0:
                    continue
                near = np.float32(share_a * aw + share_b * bw + share_c * cw)
                if near > nearness[row, column]:
                    nearness[row, column] = near
                    owner[row, column] = triangle


def fill_triangles_reference(
    corners: NDArray[np.float64],
    triangles: NDArray[np.int32],
    tilt: float,
    nearness: NDArray[np.float32],
    owner: NDArray[np.int32],
) -> None:
    """What `fill_triangles` does, over whole pictures in NumPy."""
    height, width = nearness.shape
    rows, columns = np.mgrid[0:height, 0:width]
    x = columns + 0.5 + np.where(rows % 2 == 0, tilt, -tilt)
    y = rows + 0.5 - np.where(columns % 2 == 0, tilt, -tilt)
    for triangle, (a, b, c) in enumerate(corners[triangles]):
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0 or min(a[2], b[2], c[2]) <= 0:
            continue
        share_b = (x - a[0]) * ((c[1] - a[1]) / area) + (y - a[1]) * ((a[0] - c[0]) / area)
        share_c = (x - a[0]) * ((a[1] - b[1]) / area) + (y - a[1]) * ((b[0] - a[0]) / area)
        share_a = 1 - share_b - share_c
        near = (share_a * a[2] + share_b * b[2] + share_c * c[2]).astype(np.float32)
        wins = (share_a >= 0) & (share_b >= 0) & (share_c >= 0) & (near > nearness)
        nearness[wins], owner[wins] = near[wins], triangle
