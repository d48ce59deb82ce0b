"""Two-bone limbs in closed form, over all frames at once."""

import numpy as np
from numpy.typing import NDArray

from reconstruction.motion_library.axes import turned, unit

Array = NDArray[np.float64]

FULL_REACH = 0.997
"""A limb stretches to this share of its length: the last degrees before straight would need endless joint speed."""


def two_bone(
    base: Array, target: Array, hinge: Array, upper: float, lower: float, reach: float = FULL_REACH
) -> tuple[Array, Array, Array, Array]:
    """A limb of two bones from `base` towards `target`, bending about the axis nearest to `hinge`.

    base, target, hinge: (T, 3) metres and direction, one frame of reference; upper, lower: bone lengths, metres.
    Returns unit directions of the upper and lower bone (T, 3), the hinge axis used (T, 3), and the bend (T,) radians,
    0 when straight. The lower bone is the upper one turned by the bend about the hinge. By the law of cosines.
    """
    span = target - base
    distance = np.linalg.norm(span, axis=-1)
    along = span / np.maximum(distance, 1e-9)[:, None]
    axis = unit(hinge - (hinge * along).sum(-1, keepdims=True) * along)
    distance = np.clip(distance, abs(upper - lower) + 0.02 * (upper + lower), reach * (upper + lower))
    at_base = np.arccos(np.clip((upper**2 + distance**2 - lower**2) / (2 * upper * distance), -1, 1))
    bend = np.pi - np.arccos(np.clip((upper**2 + lower**2 - distance**2) / (2 * upper * lower), -1, 1))
    first = _turn(along, axis, -at_base)
    return first, _turn(first, axis, bend), axis, bend


def _turn(vectors: Array, axis: Array, angle: Array) -> Array:
    """Rodrigues' formula for vectors at right angles to their axis."""
    return vectors * np.cos(angle)[:, None] + np.cross(axis, vectors) * np.sin(angle)[:, None]


def frame_from(down: Array, left: Array) -> Array:
    """(T, 3, 3) the rotation that takes -Y to `down` and +X to `left` (unit vectors at right angles)."""
    return np.stack([left, -down, np.cross(left, -down)], axis=-1)


def arm_frame(along: Array, hinge: Array) -> Array:
    """(T, 3, 3) the rotation that takes the left arm's rest direction +X to `along` and +Y to minus `hinge`."""
    return np.stack([along, -hinge, np.cross(along, -hinge)], axis=-1)


def local(parent_world: Array, child_world: Array) -> Array:
    """`R_parent_child` from two world rotations (..., 3, 3)."""
    return np.swapaxes(parent_world, -1, -2) @ child_world


def place(position: Array, rotation: Array, offset: Array) -> Array:
    """World position (T, 3) of a point that sits at `offset` (3,) in a moving frame."""
    return position + turned(rotation, np.broadcast_to(offset, position.shape))
