"""The studio: a backdrop, and a floor with a grid, a soft shadow and darker contact where something stands on it."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from capture.raster.triangles import fill_triangles

_TEXEL_M = 0.01
_MARGIN_M = 0.45
_MOST_TEXELS = 900
_HIGHEST_M = 100.0


@dataclass(frozen=True, eq=False)
class FloorLight:
    """How much light reaches the floor.

    share: (H, W) 0 to 1; origin: (2,) metres, x and z of its first texel's corner.
    """

    share: NDArray[np.float32]
    origin: NDArray[np.float64]
    texels_a_metre: float


def floor_light(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], height: float, to_light: NDArray[np.float64]
) -> FloorLight:
    """The shadow that surfaces throw on the floor: harder near its cause, softer away from it, dark at the contact.

    vertices: (V, 3) metres; height: the floor's y in metres; to_light: (3,) unit, towards the key light.
    """
    above = np.maximum(vertices[:, 1] - height, 0.0)
    thrown = vertices[:, (0, 2)] - above[:, None] * (to_light[[0, 2]] / to_light[1])
    corners = np.concatenate([thrown, vertices[:, (0, 2)]]) if len(vertices) else np.zeros((1, 2))
    low, high = corners.min(0) - _MARGIN_M, corners.max(0) + _MARGIN_M
    scale = min(1.0 / _TEXEL_M, _MOST_TEXELS / float((high - low).max()))
    shape = np.maximum(np.ceil((high - low) * scale).astype(int), 1)[::-1]

    blocked, cause = _print(thrown, above, triangles, low, scale, shape)
    hard, soft, vague = (gaussian_filter(blocked, metres * scale, truncate=2.5) for metres in (0.008, 0.03, 0.085))
    distance = gaussian_filter(blocked * cause, 0.04 * scale) / (gaussian_filter(blocked, 0.04 * scale) + 1e-3)
    shadow = _between(distance, hard, soft, vague)

    beneath, gap = _print(vertices[:, (0, 2)], above, triangles, low, scale, shape)
    contact = gaussian_filter(beneath * np.exp(-gap / 0.05), 0.022 * scale)
    gloom = gaussian_filter(beneath * np.exp(-gap / 0.35), 0.12 * scale)
    share = (1 - 0.42 * shadow) * (1 - 0.55 * contact) * (1 - 0.35 * gloom)
    return FloorLight(np.ascontiguousarray(share, np.float32), low, scale)


def _print(
    flat: NDArray[np.float64],
    above: NDArray[np.float64],
    triangles: NDArray[np.int32],
    low: NDArray[np.float64],
    scale: float,
    shape: NDArray[np.int_],
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Which texels surfaces cover when laid flat, and how many metres above them the lowest part was."""
    corners = np.column_stack([(flat - low) * scale, _HIGHEST_M - above])
    nearness, owner = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
    fill_triangles(np.ascontiguousarray(corners), triangles, 0.0, nearness, owner)
    covered = (owner >= 0).astype(np.float32)
    return covered, covered * (np.float32(_HIGHEST_M) - nearness)


def _between(
    distance: NDArray[np.floating], hard: NDArray[np.floating], soft: NDArray[np.floating], vague: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Hard where the cause is at the floor, soft at half a metre, vague from 1.4 metres on."""
    first = np.clip(distance / 0.5, 0, 1)
    second = np.clip((distance - 0.5) / 0.9, 0, 1)
    return hard + (soft - hard) * first + (vague - soft) * second


@njit(cache=True, inline="always")
def _sample(values, column, row):
    """Bilinear, 1 outside."""
    rows, columns = values.shape
    x, y = column - 0.5, row - 0.5
    left, top = int(np.floor(x)), int(np.floor(y))
    if left < 0 or top < 0 or left + 1 >= columns or top + 1 >= rows:
        return 1.0
    x, y = x - left, y - top
    above = values[top, left] * (1.0 - x) + values[top, left + 1] * x
    below = values[top + 1, left] * (1.0 - x) + values[top + 1, left + 1] * x
    return above * (1.0 - y) + below * y


@njit(cache=True, inline="always")
def _line_share(position, spacing, width, footprint):
    """How much of a pixel `footprint` metres wide a family of parallel lines `width` metres wide covers."""
    offset = abs(position / spacing - np.round(position / spacing)) * spacing
    seen = max(width, footprint)
    cover = min(max((0.5 * seen + 0.5 * footprint - offset) / footprint, 0.0), 1.0) * min(width / seen, 1.0)
    return cover * min(max(2.0 - 6.0 * footprint / spacing, 0.0), 1.0)


@njit(
    "void(f8[::1], f8[:,::1], f8, f8, f8, f8, f4[:,::1], f8[::1], f8, f8[:,::1], b1, f4[:,:,::1])",
    cache=True,
)
def paint_studio(
    eye, axes, focal, floor_height, spacing, fade_m, share, origin, texels_a_metre, palette, has_floor, image
):
    """Paints backdrop and floor into `image` (H, W, 3) linear, in place.

    palette: (4, 3) linear colours: backdrop above, backdrop at the horizon, floor, grid line. The floor dissolves into
    the backdrop `fade_m` metres from the camera's foot.
    """
    rows, columns = image.shape[:2]
    backdrop = np.empty(3)
    for row in range(rows):
        rise = min(max(1.0 - row / (0.62 * rows), 0.0), 1.0)
        rise = rise * rise * (3.0 - 2.0 * rise)
        for axis in range(3):
            backdrop[axis] = palette[1, axis] + rise * (palette[0, axis] - palette[1, axis])
        for column in range(columns):
            for axis in range(3):
                image[row, column, axis] = backdrop[axis]
            if not has_floor:
                continue
            right, up = (column + 0.5 - 0.5 * columns) / focal, (0.5 * rows - row - 0.5) / focal
            fall = right * axes[0, 1] + up * axes[1, 1] - axes[2, 1]
            drop = eye[1] - floor_height
            if fall * drop >= 0.0:
                continue
            reach = -drop / fall
            x = eye[0] + reach * (right * axes[0, 0] + up * axes[1, 0] - axes[2, 0])
            z = eye[2] + reach * (right * axes[0, 2] + up * axes[1, 2] - axes[2, 2])
            away = np.sqrt((x - eye[0]) ** 2 + (z - eye[2]) ** 2) / fade_m
            shown = 1.0 / (1.0 + away**4)
            # Along the line of sight a pixel covers more floor than across it.
            across = reach / focal
            slant = across / max(abs(fall) / np.sqrt(1.0 + right * right + up * up), 0.02)
            look_x, look_z = abs(x - eye[0]), abs(z - eye[2])
            level = np.sqrt(look_x * look_x + look_z * look_z) + 1e-9
            foot_x = across + (slant - across) * look_x / level
            foot_z = across + (slant - across) * look_z / level
            fine = max(_line_share(x, spacing, 0.006, foot_x), _line_share(z, spacing, 0.006, foot_z))
            strong = max(_line_share(x, 2.0 * spacing, 0.012, foot_x), _line_share(z, 2.0 * spacing, 0.012, foot_z))
            line = max(0.45 * fine, 0.9 * strong)
            light = _sample(share, (x - origin[0]) * texels_a_metre, (z - origin[1]) * texels_a_metre)
            for axis in range(3):
                colour = (palette[2, axis] + line * (palette[3, axis] - palette[2, axis])) * light
                image[row, column, axis] += shown * (colour - backdrop[axis])
