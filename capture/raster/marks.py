"""Lines and balls, drawn with smooth edges over a finished picture and hidden by what stands before them."""

import numpy as np
from numba import njit


@njit("void(f8[:,::1], i4[:,::1], f8[:,::1], f8, f8, f8, f4[:,::1], f4[:,:,::1])", cache=True)
def draw_lines(points, segments, colours, width, opacity, through, nearness, image):
    """Lays strokes with round ends over `image` (H, W, 3) linear, in place.

    points: (N, 3) column, row and nearness (1 / depth in metres; <= 0 behind the eye); segments: (S, 2);
    colours: (S, 3) linear; width: pixels; opacity, through: as in `capture.scene.Lines`; nearness: (H, W) surfaces'.
    """
    rows, columns = nearness.shape
    half = max(0.5 * width, 0.5)
    strength = min(width, 1.0)
    for segment in range(segments.shape[0]):
        ax, ay, aw = points[segments[segment, 0]]
        bx, by, bw = points[segments[segment, 1]]
        if not (aw > 0.0 and bw > 0.0):
            continue
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy + 1e-12
        reach = half + 1.0
        for row in range(max(int(min(ay, by) - reach), 0), min(int(max(ay, by) + reach) + 1, rows)):
            y = row + 0.5 - ay
            # Only the part of the row that the stroke can touch.
            left, right = min(ax, bx), max(ax, bx)
            if abs(dy) > 1e-9:
                at = ax + dx * y / dy
                spread = reach * np.sqrt(square) / abs(dy)
                left, right = max(left, at - spread), min(right, at + spread)
            for column in range(max(int(left - reach), 0), min(int(right + reach) + 1, columns)):
                x = column + 0.5 - ax
                along = min(max((x * dx + y * dy) / square, 0.0), 1.0)
                away = np.sqrt((x - along * dx) ** 2 + (y - along * dy) ** 2)
                cover = min(max(half + 0.5 - away, 0.0), 1.0)
                if cover == 0.0:
                    continue
                near = (1.0 - along) * aw + along * bw
                seen = near * 1.004 >= nearness[row, column]
                cover *= strength * (opacity if seen else through)
                for axis in range(3):
                    image[row, column, axis] += cover * (colours[segment, axis] - image[row, column, axis])


@njit("void(f8[:,::1], f8[::1], i8[::1], f8[:,::1], f8, f8, f8, f4[:,::1], f8[:,::1], f4[:,:,::1])", cache=True)
def draw_spheres(centres, radii, order, colours, opacity, through, focal, nearness, light, image):
    """Lays shaded balls over `image` (H, W, 3) linear, in place, in the given order: the farthest first.

    centres: (N, 3) column, row and nearness (1 / depth in metres); radii: (N,) metres; colours: (N, 3) linear;
    light: (3, 3) rows: direction to the key light in the camera's axes, its colour, the ambient colour.
    """
    rows, columns = nearness.shape
    for ball in order:
        cx, cy, near = centres[ball]
        if not near > 0.0:
            continue
        radius = focal * radii[ball] * near
        reach = radius + 1.0
        for row in range(max(int(cy - reach), 0), min(int(cy + reach) + 1, rows)):
            for column in range(max(int(cx - reach), 0), min(int(cx + reach) + 1, columns)):
                x, y = (column + 0.5 - cx) / radius, (cy - row - 0.5) / radius
                away = np.sqrt(x * x + y * y)
                cover = min(max((1.0 - away) * radius + 0.5, 0.0), 1.0)
                if cover == 0.0:
                    continue
                if away > 0.999:
                    x, y = x / away * 0.999, y / away * 0.999
                z = np.sqrt(max(1.0 - x * x - y * y, 0.0))
                seen = near / (1.0 - z * radii[ball] * near) * 1.004 >= nearness[row, column]
                cover *= opacity if seen else through
                shade = max((x * light[0, 0] + y * light[0, 1] + z * light[0, 2] + 0.15) / 1.15, 0.0)
                gleam = max(x * light[0, 0] + y * light[0, 1] + (z + 1.0) * light[0, 2], 0.0)
                gleam /= np.sqrt(2.0 + 2.0 * z) * np.sqrt(
                    max(light[0, 0] ** 2 + light[0, 1] ** 2 + light[0, 2] ** 2, 1e-9)
                )
                shine = 0.35 * min(gleam, 1.0) ** 40
                for axis in range(3):
                    colour = colours[ball, axis] * (light[2, axis] + shade * light[1, axis]) + shine
                    image[row, column, axis] += cover * (colour - image[row, column, axis])
