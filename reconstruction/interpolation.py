"""Interpolation of rotations: straight, along the great arc, and along a smooth curve through four keys.

Equation numbers are those of the variable-timing transition paper; K. Shoemake, "Animating Rotation with Quaternion
Curves", SIGGRAPH 1985, has the originals. Quaternions are (..., 4), (x, y, z, w), and broadcast against each other.
"""

import numpy as np
from numpy.typing import NDArray

from reconstruction.rotations import exponential, inverse, logarithm, multiply

_NEARLY_PARALLEL = 1 - 1e-9


def near_hemisphere(q: NDArray[np.float64], reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """`q` or `-q`, whichever is nearer to `reference`: the same rotation."""
    return np.where(np.sum(q * reference, axis=-1, keepdims=True) < 0, -q, q)


def normalised_lerp(a: NDArray[np.float64], b: NDArray[np.float64], h: NDArray | float) -> NDArray[np.float64]:
    """Eq. 6, normalised, the short way round; h: (...) 0 at a, 1 at b."""
    h = np.asarray(h)[..., None]
    q = (1 - h) * a + h * near_hemisphere(b, a)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def slerp(a: NDArray[np.float64], b: NDArray[np.float64], h: NDArray | float) -> NDArray[np.float64]:
    """Eq. 7, (sin((1-h) theta) a + sin(h theta) b) / sin theta, the short way round; h: (...) 0 at a, 1 at b."""
    return _arc(a, near_hemisphere(b, a), h)


def squad(
    before: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64], after: NDArray[np.float64], h: NDArray
) -> NDArray[np.float64]:
    """Eq. 8: from `a` to `b`, bending towards the keys `before` a and `after` b; h: (...) 0 at a, 1 at b."""
    before, b = near_hemisphere(before, a), near_hemisphere(b, a)
    after = near_hemisphere(after, b)
    h = np.asarray(h)
    inner = _arc(squad_control(before, a, b), squad_control(a, b, after), h)
    # The control points may lie on the far hemisphere: the arcs must not take the short way back.
    return _arc(_arc(a, b, h), inner, 2 * h * (1 - h))


def squad_control(
    before: NDArray[np.float64], q: NDArray[np.float64], after: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Eq. 9: q exp(-(log(q^-1 before) + log(q^-1 after)) / 4), the key between `before` and `after` pulled aside."""
    bend = logarithm(multiply(inverse(q), before)) + logarithm(multiply(inverse(q), after))
    # `logarithm` gives rotation vectors, twice the quaternion logarithm that eq. 9 has; `exponential` halves again.
    return multiply(q, exponential(-bend / 4))


def _arc(a: NDArray[np.float64], b: NDArray[np.float64], h: NDArray | float) -> NDArray[np.float64]:
    """The great arc from a to b as they stand, without choice of hemisphere."""
    h = np.asarray(h)[..., None]
    cosine = np.sum(a * b, axis=-1, keepdims=True)
    angle = np.arccos(np.clip(cosine, -1, 1))
    sine = np.sin(angle)
    straight = np.abs(cosine) > _NEARLY_PARALLEL
    safe = np.where(straight, 1.0, sine)
    wa = np.where(straight, 1 - h, np.sin((1 - h) * angle) / safe)
    wb = np.where(straight, h * np.where(cosine < 0, -1, 1), np.sin(h * angle) / safe)
    q = wa * a + wb * b
    return q / np.linalg.norm(q, axis=-1, keepdims=True)
