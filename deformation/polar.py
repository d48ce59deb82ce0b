"""The rotation in a 3x3 matrix: M = R S (eq. 2)."""

import numpy as np
from numpy.typing import NDArray

from deformation.kernel import kernel

_STEPS = 20
_CONVERGED = 1e-10
"""Squared change of a step after which the next would change less than 1e-10."""
_FLAT = 1e-9
"""Determinant, against the cube of the matrix' size, from which on a matrix turns nothing that could be told."""


@kernel
def cofactors(m):
    """The cofactor matrix of nine numbers m, row by row."""
    return (
        m[4] * m[8] - m[5] * m[7],
        m[5] * m[6] - m[3] * m[8],
        m[3] * m[7] - m[4] * m[6],
        m[2] * m[7] - m[1] * m[8],
        m[0] * m[8] - m[2] * m[6],
        m[1] * m[6] - m[0] * m[7],
        m[1] * m[5] - m[2] * m[4],
        m[2] * m[3] - m[0] * m[5],
        m[0] * m[4] - m[1] * m[3],
    )


@kernel
def determinant(m):
    """The determinant of nine numbers m, row by row."""
    return m[0] * (m[4] * m[8] - m[5] * m[7]) + m[1] * (m[5] * m[6] - m[3] * m[8]) + m[2] * (m[3] * m[7] - m[4] * m[6])


@kernel
def norm_squared(m):
    """The sum of nine squares."""
    return (
        m[0] * m[0]
        + m[1] * m[1]
        + m[2] * m[2]
        + m[3] * m[3]
        + m[4] * m[4]
        + m[5] * m[5]
        + m[6] * m[6]
        + m[7] * m[7]
        + m[8] * m[8]
    )


@kernel
def polar(m):
    """(found, R): the rotation nearest to nine numbers m, by Newton steps X <- (g X + X^-T / g) / 2 (Higham 1986).

    g is Higham's factor that makes X and its inverse equally large. Nothing is found where m is flat or inside out.
    """
    for _ in range(_STEPS):
        c = cofactors(m)
        det = m[0] * c[0] + m[1] * c[1] + m[2] * c[2]
        size = norm_squared(m)
        if det <= _FLAT * size * np.sqrt(size):
            return False, m
        scale = np.sqrt(np.sqrt(norm_squared(c) / (det * det * size)))
        a, b = 0.5 * scale, 0.5 / (scale * det)
        new = (
            a * m[0] + b * c[0],
            a * m[1] + b * c[1],
            a * m[2] + b * c[2],
            a * m[3] + b * c[3],
            a * m[4] + b * c[4],
            a * m[5] + b * c[5],
            a * m[6] + b * c[6],
            a * m[7] + b * c[7],
            a * m[8] + b * c[8],
        )
        change = (
            (new[0] - m[0]) ** 2
            + (new[1] - m[1]) ** 2
            + (new[2] - m[2]) ** 2
            + (new[4] - m[4]) ** 2
            + (new[5] - m[5]) ** 2
            + (new[8] - m[8]) ** 2
        )
        m = new
        if change < _CONVERGED:
            break
    return True, m


_SMALL_TURN = 0.25
"""Squared vector part of a quaternion up to which a step of `polar_near_identity` is trusted."""


@kernel
def polar_near_identity(m):
    """`polar` of a matrix whose rotation is small: two or three Newton steps on the rotation itself, each quadratic.

    With S = R^T M the turn that is left solves (tr S - S) w = axis of S - S^T. Hands over to `polar` where it is large.
    """
    size = norm_squared(m)
    if determinant(m) <= _FLAT * size * np.sqrt(size):
        return False, m
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    r = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    s = m
    for _ in range(4):
        a, b, c = s[4] + s[8], s[0] + s[8], s[0] + s[4]
        d, e, f = -0.5 * (s[1] + s[3]), -0.5 * (s[2] + s[6]), -0.5 * (s[5] + s[7])
        gx, gy, gz = s[7] - s[5], s[2] - s[6], s[3] - s[1]
        xx, xy, xz = b * c - f * f, e * f - d * c, d * f - b * e
        det = a * xx + d * xy + e * xz
        if not (a > 0.0 and a * b > d * d and det > 1e-9 * (a + b + c) ** 3):
            return polar(m)
        yy, yz, zz = a * c - e * e, d * e - a * f, a * b - d * d
        half = 0.5 / det
        tx = half * (xx * gx + xy * gy + xz * gz)
        ty = half * (xy * gx + yy * gy + yz * gz)
        tz = half * (xz * gx + yz * gy + zz * gz)
        turn = tx * tx + ty * ty + tz * tz
        if turn > _SMALL_TURN:
            return polar(m)
        w, x, y, z = (
            w - x * tx - y * ty - z * tz,
            x + w * tx + y * tz - z * ty,
            y + w * ty + z * tx - x * tz,
            z + w * tz + x * ty - y * tx,
        )
        n = 2.0 / (w * w + x * x + y * y + z * z)
        r = (
            1.0 - n * (y * y + z * z),
            n * (x * y - z * w),
            n * (x * z + y * w),
            n * (x * y + z * w),
            1.0 - n * (x * x + z * z),
            n * (y * z - x * w),
            n * (x * z - y * w),
            n * (y * z + x * w),
            1.0 - n * (x * x + y * y),
        )
        if turn < 1e-8:
            break
        s = (
            r[0] * m[0] + r[3] * m[3] + r[6] * m[6],
            r[0] * m[1] + r[3] * m[4] + r[6] * m[7],
            r[0] * m[2] + r[3] * m[5] + r[6] * m[8],
            r[1] * m[0] + r[4] * m[3] + r[7] * m[6],
            r[1] * m[1] + r[4] * m[4] + r[7] * m[7],
            r[1] * m[2] + r[4] * m[5] + r[7] * m[8],
            r[2] * m[0] + r[5] * m[3] + r[8] * m[6],
            r[2] * m[1] + r[5] * m[4] + r[8] * m[7],
            r[2] * m[2] + r[5] * m[5] + r[8] * m[8],
        )
    return True, r


def polar_reference(matrices: NDArray[np.float64], otherwise: NDArray[np.float64]) -> NDArray[np.float64]:
    """`polar` of matrices (N, 3, 3) by singular values in plain NumPy; `otherwise` where nothing is found."""
    u, size, vt = np.linalg.svd(matrices)
    det = np.linalg.det(matrices)
    found = det > _FLAT * (size**2).sum(axis=1) ** 1.5
    return np.where(found[:, None, None], u @ vt, otherwise)
