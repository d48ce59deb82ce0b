"""The curve of the default method: a quintic that leaves and enters with the clips' own speeds and accelerations.

The paper's slerp and squad meet the clips' poses, and their directions at best; a quintic Hermite curve meets speed and
acceleration too, so that the seam shows neither. On rotations it runs in the rotation vectors from the frame left.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from reconstruction.rotations import cross, exponential, multiply
from reconstruction.transition.clip import angular_accelerations


def quintic_weights(t: NDArray[np.float64], duration: float) -> NDArray[np.float64]:
    """(N, 6) weights of (x0, v0, a0, x1, v1, a1) in the quintic at times t (N,), held to 0 <= t <= duration seconds.

    x, v, a: value, speed, acceleration at the start and, with 1, at the end.
    """
    return quintic_weights_kernel(t, duration)


def quintic_weights_plain(t: NDArray[np.float64], duration: float) -> NDArray[np.float64]:
    """Plain form of `quintic_weights`."""
    s = np.clip(t / duration, 0.0, 1.0)
    s2, s3 = s * s, s * s * s
    s4, s5 = s2 * s2, s2 * s3
    rise = 10 * s3 - 15 * s4 + 6 * s5
    return np.stack(
        (
            1 - rise,
            duration * (s - 6 * s3 + 8 * s4 - 3 * s5),
            duration**2 * 0.5 * (s2 - 3 * s3 + 3 * s4 - s5),
            rise,
            duration * (-4 * s3 + 7 * s4 - 3 * s5),
            duration**2 * 0.5 * (s3 - 2 * s4 + s5),
        ),
        axis=-1,
    )


@njit(cache=True)
def quintic_weights_kernel(t, duration):  # pragma: no cover - compiled
    """See `quintic_weights`."""
    out = np.empty((len(t), 6))
    for n in range(len(t)):
        s = min(max(t[n] / duration, 0.0), 1.0)
        s3 = s * s * s
        rise = s3 * (10 - 15 * s + 6 * s * s)
        out[n, 0] = 1 - rise
        out[n, 1] = duration * (s - s3 * (6 - 8 * s + 3 * s * s))
        out[n, 2] = duration * duration * 0.5 * (s * s - s3 * (3 - 3 * s + s * s))
        out[n, 3] = rise
        out[n, 4] = duration * s3 * (-4 + 7 * s - 3 * s * s)
        out[n, 5] = duration * duration * 0.5 * s3 * (1 - 2 * s + s * s)
    return out


def trend_weights(t: NDArray[np.float64], duration: float, fading_s: float) -> NDArray[np.float64]:
    """`quintic_weights` whose end speeds and accelerations fade within `fading_s`: no long swing of their own."""
    weights = quintic_weights(t, duration)
    fading = min(duration, fading_s)
    weights[:, 1:3] = quintic_weights(t, fading)[:, 1:3]
    weights[:, 4:] = quintic_weights(t - (duration - fading), fading)[:, 4:]
    return weights


def body_to_vector_rate(phi: NDArray[np.float64], omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rate (..., 3) of the rotation vector `phi` whose rotation turns at `omega` rad/s in its own axes.

    The inverse right Jacobian of SO(3): J. Sola, J. Deray, D. Atchuthan, "A micro Lie theory", 2018, eq. 144.
    """
    angle = np.linalg.norm(phi, axis=-1, keepdims=True)
    half = np.maximum(angle / 2, 1e-9)
    bend = np.where(angle < 1e-4, 1 / 12, (1 - half / np.tan(half)) / np.maximum(angle, 1e-9) ** 2)
    turned = cross(phi, omega)
    return omega + turned / 2 + bend * cross(phi, turned)


def turned_by(start: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Plain form of `turned_by_kernel`."""
    return multiply(start, exponential(vectors))


@njit(cache=True)
def turned_by_kernel(start, vectors):  # pragma: no cover - compiled
    """(N, J, 4) `start[j] exp(vectors[n, j])`; start: (J, 4) quaternions, vectors: (N, J, 3) radians."""
    count, joints = vectors.shape[0], vectors.shape[1]
    out = np.empty((count, joints, 4))
    for n in range(count):
        for j in range(joints):
            x, y, z = vectors[n, j, 0], vectors[n, j, 1], vectors[n, j, 2]
            angle = np.sqrt(x * x + y * y + z * z)
            scale = 0.5 - angle * angle / 48 if angle < 1e-4 else np.sin(angle / 2) / angle
            x, y, z, w = x * scale, y * scale, z * scale, np.cos(angle / 2)
            ax, ay, az, aw = start[j, 0], start[j, 1], start[j, 2], start[j, 3]
            out[n, j, 0] = aw * x + ax * w + ay * z - az * y
            out[n, j, 1] = aw * y - ax * z + ay * w + az * x
            out[n, j, 2] = aw * z + ax * y - ay * x + az * w
            out[n, j, 3] = aw * w - ax * x - ay * y - az * z
    return out


def peak_acceleration(rotations: NDArray[np.float64], fps: float) -> float:
    """Plain form of `peak_acceleration_kernel`."""
    return float(angular_accelerations(rotations, fps).max(initial=0.0))


@njit(cache=True)
def peak_acceleration_kernel(rotations, fps):  # pragma: no cover - compiled
    """rad/s^2: the largest second difference of the rotation of any joint; rotations: (N, J, 4)."""
    frames, joints = rotations.shape[0], rotations.shape[1]
    worst = 0.0
    for j in range(joints):
        px = py = pz = 0.0
        for n in range(frames - 1):
            ax, ay, az, aw = rotations[n, j, 0], rotations[n, j, 1], rotations[n, j, 2], rotations[n, j, 3]
            bx, by, bz, bw = (
                rotations[n + 1, j, 0],
                rotations[n + 1, j, 1],
                rotations[n + 1, j, 2],
                rotations[n + 1, j, 3],
            )
            w = aw * bw + ax * bx + ay * by + az * bz
            x = aw * bx - ax * bw - ay * bz + az * by
            y = aw * by + ax * bz - ay * bw - az * bx
            z = aw * bz - ax * by + ay * bx - az * bw
            if w < 0:
                w, x, y, z = -w, -x, -y, -z
            sine = np.sqrt(x * x + y * y + z * z)
            scale = 2.0 if sine < 1e-9 else 2 * np.arctan2(sine, w) / sine
            x, y, z = x * scale, y * scale, z * scale
            if n > 0:
                size = (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2
                if size > worst:
                    worst = size
            px, py, pz = x, y, z
    return np.sqrt(worst) * fps * fps
