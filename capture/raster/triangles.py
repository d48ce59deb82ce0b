"""Which triangle is nearest at each sample of a picture: the z-buffer."""

import numpy as np
from numba import njit

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
