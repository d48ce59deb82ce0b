"""Rotation matrices about the axes of the body: X to its left, Y up, Z forward."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIRROR = np.diag([-1.0, 1.0, 1.0])
"""Left to right: a rotation R of the left side is MIRROR @ R @ MIRROR on the right."""


def about_x(angle: Array) -> Array:
    """(..., 3, 3) turns +Y towards +Z: leaning forward. angle: (...) radians."""
    return _plane_rotation(angle, 1, 2)


def about_y(angle: Array) -> Array:
    """(..., 3, 3) turns +Z towards +X: facing left. angle: (...) radians."""
    return _plane_rotation(angle, 2, 0)


def about_z(angle: Array) -> Array:
    """(..., 3, 3) turns +X towards +Y: the left side rises. angle: (...) radians."""
    return _plane_rotation(angle, 0, 1)


def _plane_rotation(angle: Array, source: int, target: int) -> Array:
    angle = np.asarray(angle, float)
    matrix = np.zeros((*angle.shape, 3, 3))
    axis = 3 - source - target
    matrix[..., axis, axis] = 1
    matrix[..., source, source] = matrix[..., target, target] = np.cos(angle)
    matrix[..., target, source] = np.sin(angle)
    matrix[..., source, target] = -matrix[..., target, source]
    return matrix


def unit(vectors: Array) -> Array:
    """The same directions (..., 3) with length one."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def turned(rotation: Array, vector: Array) -> Array:
    """Rotations (..., 3, 3) applied to vectors (..., 3)."""
    return np.einsum("...ij,...j->...i", rotation, vector)
