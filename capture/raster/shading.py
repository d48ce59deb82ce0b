"""The light on a surface: what each pixel shows, its ambient occlusion and its colour under the studio lights."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_TAPS = 14
AO_RADIUS_M = 0.16
SEARCH_RADIUS_M = 0.05
SHADOW_BIAS_M = 0.004


def _spirals() -> NDArray[np.float64]:
    """(16, taps, 2) points of a sunflower spiral in the unit circle, at sixteen turns."""
    tap, turn = np.arange(_TAPS), np.arange(16) * 7 * np.pi / 8
    angle = turn[:, None] + 2.399963 * tap  # the golden angle
    return np.sqrt((tap + 0.5) / _TAPS)[:, None] * np.stack([np.sin(angle), np.cos(angle)], axis=-1)


SPIRALS = _spirals()


@njit(cache=True, inline="always")
def _shares(corners, triangle, x, y):
    """Perspective-correct barycentric coordinates of a sample, and whether the triangle's front is seen."""
    a, b, c = corners[triangle[0]], corners[triangle[1]], corners[triangle[2]]
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    share_b = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
    share_c = ((y - a[1]) * (b[0] - a[0]) - (x - a[0]) * (b[1] - a[1])) / area
    u, v, w = (1.0 - share_b - share_c) * a[2], share_b * b[2], share_c * c[2]
    total = u + v + w
    return u / total, v / total, w / total, area < 0.0


@njit(cache=True, inline="always")
def _blend(values, triangle, u, v, w, axis):
    return u * values[triangle[0], axis] + v * values[triangle[1], axis] + w * values[triangle[2], axis]


@njit(
    "void(f4[:,::1], i4[:,::1], f8[:,::1], i4[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], i8, f8, f4[:,:,::1], f4[:,::1])",
    cache=True,
)
def resolve_samples(
    nearness, owner, corners, triangles, vertices, normals, colours, samples, tilt, pixels, pixel_nearness
):
    """What the surface is at each pixel: pixels (H, W, 10) gets position, normal, colour (3 each) and coverage.

    nearness, owner: (H * samples, W * samples) from `fill_triangles` with the same corners and tilt. vertices: (V, 3)
    metres; normals: (V, 3); colours: (V, 3) linear. A pixel holds the mean of its covered samples, or only the first
    where they lie so close together that no edge can run between them; the normal looks to the eye.
    pixel_nearness: (H, W) gets that of the nearest sample.
    """
    rows, columns = pixels.shape[:2]
    for row in range(rows):
        for column in range(columns):
            covered, nearest, farthest = 0, np.float32(0.0), np.float32(np.inf)
            for sub in range(samples * samples):
                y, x = row * samples + sub // samples, column * samples + sub % samples
                if owner[y, x] >= 0:
                    covered += 1
                    nearest = max(nearest, nearness[y, x])
                    farthest = min(farthest, nearness[y, x])
            if covered == 0:
                continue
            pixels[row, column, 9] = covered / (samples * samples)
            pixel_nearness[row, column] = nearest
            wanted = 1 if nearest < 1.004 * farthest else covered
            taken = 0
            for sub in range(samples * samples):
                y, x = row * samples + sub // samples, column * samples + sub % samples
                face = owner[y, x]
                if face < 0 or taken == wanted:
                    continue
                taken += 1
                triangle = triangles[face]
                across = x + 0.5 + (tilt if y % 2 == 0 else -tilt)
                down = y + 0.5 - (tilt if x % 2 == 0 else -tilt)
                u, v, w, front = _shares(corners, triangle, across, down)
                facing = 1.0 if front else -1.0
                for axis in range(3):
                    pixels[row, column, axis] += _blend(vertices, triangle, u, v, w, axis) / wanted
                    pixels[row, column, 3 + axis] += facing * _blend(normals, triangle, u, v, w, axis) / wanted
                    pixels[row, column, 6 + axis] += _blend(colours, triangle, u, v, w, axis) / wanted


@njit("void(f4[:,:,::1], f8[::1], f8[:,::1], f8, f4[:,::1])", cache=True)
def occlude(pixels, eye, axes, focal, openness):
    """Ambient occlusion from the picture itself, in place: openness (H, W), 1 where nothing stands near.

    After McGuire et al., The Alchemy Screen-Space Ambient Obscurance Algorithm (HPG 2011), eq. 10, with points of a
    spiral whose turn changes over 4 x 4 pixels; the caller averages over those. focal: pixels. axes: `R_camera_world`.
    """
    rows, columns = openness.shape
    for row in range(rows):
        for column in range(columns):
            if pixels[row, column, 9] == 0.0:
                continue
            here = pixels[row, column]
            depth = 0.0
            for axis in range(3):
                depth += (eye[axis] - here[axis]) * axes[2, axis]
            reach = min(focal * AO_RADIUS_M / depth, 120.0)
            turn = (row % 4) * 4 + column % 4
            hidden = 0.0
            for tap in range(_TAPS):
                y, x = row + int(reach * SPIRALS[turn, tap, 0]), column + int(reach * SPIRALS[turn, tap, 1])
                if y < 0 or x < 0 or y >= rows or x >= columns or pixels[y, x, 9] == 0.0:
                    continue
                along, square = 0.0, 0.0
                for axis in range(3):
                    step = pixels[y, x, axis] - here[axis]
                    along += step * here[3 + axis]
                    square += step * step
                if square < 4.0 * AO_RADIUS_M * AO_RADIUS_M:
                    hidden += max(along - 0.002 * depth, 0.0) / (square + 0.0004)
            openness[row, column] = max(0.0, 1.0 - 1.1 * AO_RADIUS_M * hidden / _TAPS) ** 1.2


@njit("void(f4[:,::1], f4[:,:,::1], f4[:,::1])", cache=True)
def smooth_turns(values, pixels, smooth):
    """The mean of `values` (H, W) over 4 x 4 pixels of the same place, into `smooth`: takes the spirals' turns out."""
    rows, columns = values.shape
    for row in range(rows):
        for column in range(columns):
            if pixels[row, column, 9] == 0.0:
                continue
            total, weight = 0.0, 0.0
            for y in range(max(row - 2, 0), min(row + 2, rows)):
                for x in range(max(column - 2, 0), min(column + 2, columns)):
                    if pixels[y, x, 9] == 0.0:
                        continue
                    square = 0.0
                    for axis in range(3):
                        step = pixels[y, x, axis] - pixels[row, column, axis]
                        square += step * step
                    if square < 0.0025:
                        total += values[y, x]
                        weight += 1.0
            smooth[row, column] = total / weight


@njit(cache=True, inline="always")
def _above(shadow, row, column, depth):
    """How many metres nearer to the light than `depth` the shadow map is there; 0 outside it."""
    if row < 0 or column < 0 or row >= shadow.shape[0] or column >= shadow.shape[1]:
        return 0.0
    return max(shadow[int(row), int(column)] - depth - SHADOW_BIAS_M, 0.0)


@njit("void(f4[:,:,::1], f4[:,::1], f8[:,::1], f8[::1], f8, f4[:,::1])", cache=True)
def receive_key_light(pixels, shadow, light_axes, light_origin, texels_a_metre, lit):
    """How much of the key light reaches each pixel, in place: lit (H, W), 1 where nothing stands in its way.

    Percentage-closer soft shadows (Fernando, SIGGRAPH 2005 sketches): the farther what hides the light, the softer the
    edge. shadow: (S, S) metres towards the light; light_axes, light_origin: world to light. The taps turn from pixel to
    pixel as in `occlude`; the caller smooths.
    """
    rows, columns = lit.shape
    for row in range(rows):
        for column in range(columns):
            if pixels[row, column, 9] == 0.0:
                continue
            place = np.zeros(3)
            for axis in range(3):
                for part in range(3):
                    off_surface = pixels[row, column, part] + 0.008 * pixels[row, column, 3 + part]
                    place[axis] += light_axes[axis, part] * off_surface
                place[axis] -= light_origin[axis]
            u, v = place[0] * texels_a_metre, place[1] * texels_a_metre
            turn = (row % 4) * 4 + column % 4
            reach = SEARCH_RADIUS_M * texels_a_metre
            gap, found = 0.0, 0
            for tap in range(_TAPS):
                y, x = SPIRALS[turn, tap]
                above = _above(shadow, v + reach * y, u + reach * x, place[2])
                if above > 0.0:
                    gap += above
                    found += 1
            if found == 0:
                continue
            reach = min(max(0.16 * gap / found, 0.005), SEARCH_RADIUS_M) * texels_a_metre
            dark = 0.0
            for tap in range(_TAPS):
                y, x = SPIRALS[turn, tap]
                dark += min(_above(shadow, v + reach * y, u + reach * x, place[2]) / 0.004, 1.0)
            lit[row, column] = 1.0 - dark / _TAPS


@njit(
    "void(f4[:,:,::1], f4[:,::1], f4[:,::1], f8[::1], f8[:,::1], f8, f4[:,:,::1])",
    cache=True,
)
def light_pixels(pixels, openness, lit, eye, lights, opacity, image):
    """Lays the lit surface over `image` (H, W, 3) linear, in place.

    lights: (3, 6) key, fill and rim: direction towards the light and its colour. openness, lit: (H, W).
    opacity: below 1 the surface is a ghost, clearer where it faces the eye.
    """
    rows, columns = openness.shape
    for row in range(rows):
        for column in range(columns):
            coverage = pixels[row, column, 9]
            if coverage == 0.0:
                continue
            px, py, pz = pixels[row, column, 0], pixels[row, column, 1], pixels[row, column, 2]
            nx, ny, nz = pixels[row, column, 3], pixels[row, column, 4], pixels[row, column, 5]
            length = np.sqrt(nx * nx + ny * ny + nz * nz) + 1e-12
            nx, ny, nz = nx / length, ny / length, nz / length
            vx, vy, vz = eye[0] - px, eye[1] - py, eye[2] - pz
            length = np.sqrt(vx * vx + vy * vy + vz * vz)
            vx, vy, vz = vx / length, vy / length, vz / length
            grazing = 1.0 - min(max(nx * vx + ny * vy + nz * vz, 0.0), 1.0)
            open_share = openness[row, column]
            sky = 0.5 + 0.5 * ny
            red = (0.11 + 0.16 * sky) * open_share
            green = (0.10 + 0.18 * sky) * open_share
            blue = (0.10 + 0.21 * sky) * open_share
            shine_red = shine_green = shine_blue = 0.0
            for index in range(3):
                light = lights[index]
                cosine = nx * light[0] + ny * light[1] + nz * light[2]
                share = lit[row, column] if index == 0 else 0.4 + 0.6 * open_share
                diffuse = share * max((cosine + 0.12) / 1.12, 0.0)
                hx, hy, hz = light[0] + vx, light[1] + vy, light[2] + vz
                half = (nx * hx + ny * hy + nz * hz) / (np.sqrt(hx * hx + hy * hy + hz * hz) + 1e-12)
                shine = share * (0.07 + 0.6 * grazing**5) * max(half, 0.0) ** 36 * (1.0 if cosine > 0.0 else 0.0)
                if index == 2:
                    shine += share * 0.30 * grazing**3 * max(cosine, 0.0)
                red += diffuse * light[3]
                green += diffuse * light[4]
                blue += diffuse * light[5]
                shine_red += shine * light[3]
                shine_green += shine * light[4]
                shine_blue += shine * light[5]
            alpha = coverage
            if opacity < 1.0:
                alpha *= opacity * min(0.45 + 1.1 * grazing, 1.0)
            image[row, column, 0] += alpha * (pixels[row, column, 6] * red + shine_red - image[row, column, 0])
            image[row, column, 1] += alpha * (pixels[row, column, 7] * green + shine_green - image[row, column, 1])
            image[row, column, 2] += alpha * (pixels[row, column, 8] * blue + shine_blue - image[row, column, 2])
