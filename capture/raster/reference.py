"""The kernels of this package again, over whole pictures in NumPy: slow, short, and what the tests hold them to.

Arguments and results are those of the kernel of the same name.
"""

import numpy as np
from numpy.typing import NDArray

from capture.raster.shading import AO_RADIUS_M, SEARCH_RADIUS_M, SHADOW_BIAS_M, SPIRALS

Floats = NDArray[np.floating]


def fill_triangles(
    corners: NDArray[np.float64],
    triangles: NDArray[np.int32],
    tilt: float,
    nearness: NDArray[np.float32],
    owner: NDArray[np.int32],
) -> None:
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


def occlude(pixels: Floats, eye: Floats, axes: Floats, focal: float, openness: Floats) -> None:
    covered = pixels[..., 9] > 0
    depth = (eye - pixels[..., :3]) @ axes[2]
    reach = np.minimum(focal * AO_RADIUS_M / np.where(covered, depth, 1.0), 120.0)
    hidden = np.zeros(depth.shape)
    for row, column, there, inside in _taps(reach):
        step = pixels[row, column, :3].astype(float) - pixels[..., :3]
        along, square = (step * pixels[..., 3:6]).sum(-1), (step**2).sum(-1)
        counts = inside & there(covered) & (square < 4 * AO_RADIUS_M**2)
        hidden += np.where(counts, np.maximum(along - 0.002 * depth, 0) / (square + 0.0004), 0)
    share = np.maximum(0, 1 - 1.1 * AO_RADIUS_M * hidden / SPIRALS.shape[1]) ** 1.2
    openness[covered] = share[covered]


def _taps(reach: Floats):
    rows, columns = np.indices(reach.shape)
    turn = (rows % 4) * 4 + columns % 4
    for tap in range(SPIRALS.shape[1]):
        row = rows + (reach * SPIRALS[turn, tap, 0]).astype(int)
        column = columns + (reach * SPIRALS[turn, tap, 1]).astype(int)
        inside = (row >= 0) & (column >= 0) & (row < reach.shape[0]) & (column < reach.shape[1])
        row, column = np.where(inside, row, 0), np.where(inside, column, 0)
        yield row, column, lambda values, at=(row, column): values[at], inside


def smooth_turns(values: Floats, pixels: Floats, smooth: Floats) -> None:
    rows, columns = values.shape
    for row, column in np.argwhere(pixels[..., 9] > 0):
        near = slice(max(row - 2, 0), min(row + 2, rows)), slice(max(column - 2, 0), min(column + 2, columns))
        square = ((pixels[near][..., :3].astype(float) - pixels[row, column, :3]) ** 2).sum(-1)
        same = (square < 0.0025) & (pixels[near][..., 9] > 0)
        smooth[row, column] = values[near][same].mean()


def receive_key_light(
    pixels: Floats, shadow: Floats, light_axes: Floats, light_origin: Floats, texels_a_metre: float, lit: Floats
) -> None:
    covered = pixels[..., 9] > 0
    off_surface = pixels[..., :3].astype(float) + 0.008 * pixels[..., 3:6]
    u, v, depth = np.moveaxis(off_surface @ light_axes.T - light_origin, -1, 0)
    rows, columns = np.indices(covered.shape)
    offsets = SPIRALS[(rows % 4) * 4 + columns % 4]

    def above(reach_m: Floats | float) -> Floats:
        reach = np.asarray(reach_m)[..., None] * texels_a_metre
        row = v[..., None] * texels_a_metre + reach * offsets[..., 0]
        column = u[..., None] * texels_a_metre + reach * offsets[..., 1]
        inside = (row >= 0) & (column >= 0) & (row < shadow.shape[0]) & (column < shadow.shape[1])
        found = shadow[np.where(inside, row, 0).astype(int), np.where(inside, column, 0).astype(int)]
        return np.where(inside, np.maximum(found - depth[..., None] - SHADOW_BIAS_M, 0), 0)

    gaps = above(SEARCH_RADIUS_M)
    found = (gaps > 0).sum(-1)
    reach_m = np.clip(0.16 * gaps.sum(-1) / np.maximum(found, 1), 0.005, SEARCH_RADIUS_M)
    dark = np.minimum(above(reach_m) / 0.004, 1).mean(-1)
    hidden = covered & (found > 0)
    lit[hidden] = 1 - dark[hidden]


def light_pixels(
    pixels: Floats, openness: Floats, lit: Floats, eye: Floats, lights: Floats, opacity: float, image: Floats
) -> None:
    normal = _unit(pixels[..., 3:6].astype(float))
    to_eye = _unit(eye - pixels[..., :3])
    grazing = 1 - np.clip((normal * to_eye).sum(-1), 0, 1)
    sky = (0.5 + 0.5 * normal[..., 1])[..., None]
    light = ([0.11, 0.10, 0.10] + sky * [0.16, 0.18, 0.21]) * openness[..., None]
    gleam = np.zeros_like(light)
    for index, (direction, colour) in enumerate(zip(lights[:, :3], lights[:, 3:], strict=True)):
        cosine = normal @ direction
        share = lit if index == 0 else 0.4 + 0.6 * openness
        half = np.maximum((normal * _unit(direction + to_eye)).sum(-1), 0)
        shine = share * (0.07 + 0.6 * grazing**5) * half**36 * (cosine > 0)
        if index == 2:
            shine = shine + share * 0.30 * grazing**3 * np.maximum(cosine, 0)
        light = light + (share * np.maximum((cosine + 0.12) / 1.12, 0))[..., None] * colour
        gleam = gleam + shine[..., None] * colour
    alpha = pixels[..., 9]
    if opacity < 1:
        alpha = alpha * opacity * np.minimum(0.45 + 1.1 * grazing, 1)
    shown = pixels[..., 6:9] * light + gleam
    covered = pixels[..., 9] > 0
    image[covered] += (alpha[..., None] * (shown - image))[covered]


def _unit(vectors: Floats) -> Floats:
    return vectors / (np.linalg.norm(vectors, axis=-1, keepdims=True) + 1e-12)


def draw_lines(
    points: Floats,
    segments: NDArray[np.int32],
    colours: Floats,
    width: float,
    opacity: float,
    through: float,
    nearness: Floats,
    image: Floats,
) -> None:
    y, x = np.indices(nearness.shape) + 0.5
    half = max(0.5 * width, 0.5)
    for (start, end), colour in zip(points[segments], colours, strict=True):
        if not (start[2] > 0 and end[2] > 0):
            continue
        dx, dy = end[:2] - start[:2]
        along = np.clip(((x - start[0]) * dx + (y - start[1]) * dy) / (dx * dx + dy * dy + 1e-12), 0, 1)
        away = np.hypot(x - start[0] - along * dx, y - start[1] - along * dy)
        seen = (start[2] + along * (end[2] - start[2])) * 1.004 >= nearness
        cover = np.clip(half + 0.5 - away, 0, 1) * min(width, 1) * np.where(seen, opacity, through)
        image += (cover[..., None] * (colour - image)).astype(image.dtype)
