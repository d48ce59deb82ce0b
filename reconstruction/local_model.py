"""The default prior: what the neighbours say of this pose, and of the step to it, as one Gaussian.

Where the paper predicts every degree of freedom alone (`local_regression`), this keeps how they vary together among
the neighbours, so that a tracker pulls a whole arm as arms move. Two statements are multiplied:

- pose: q_t ~ N(weighted mean of the neighbours' y_k, their covariance plus a floor);
- step: q_t ~ N(q_{t-1} + weighted mean of y_k - x_k, the steps' spread plus a floor), which carries what the trackers
  do not see, and damps jitter.

Neighbours that are far differ from the truth by more than from each other, and in other ways: then the covariance of
all poses of the database, in proportion to the squared distance, is added to the first, and both floors rise.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs

from reconstruction.map_problem import GaussianPrior


@dataclass(frozen=True)
class LocalModelSettings:
    """How neighbours become a Gaussian.

    pose_floor: radians (metres for the root), standard deviation added to every coordinate's spread, above 0.
    step_floor: the same for the step.
    background: standard deviations of the database that a pose may differ from neighbours at the distance where their
        widening is sqrt(2), 0 or more.
    pose_widening: times the neighbours' own spread, above 0.
    step_widening: times the steps' own spread, above 0.
    """

    pose_floor: float = 0.02
    step_floor: float = 0.015
    pose_widening: float = 1.5
    step_widening: float = 4.0
    background: float = 0.2


def local_prior(
    following: NDArray[np.float64],
    steps: NDArray[np.float64],
    weights: NDArray[np.float64],
    last: NDArray[np.float64] | None,
    widening: float,
    everything: NDArray[np.float64],
    settings: LocalModelSettings,
) -> GaussianPrior:
    """The prior from K neighbours.

    following: (K, D), y_k; steps: (K, D), y_k - x_k; weights: (K,), summing to one; last: (D,) q_{t-1} or None where
    there is no history; widening: 1 inside the data, in proportion to the neighbours' distance outside;
    everything: (D, D), the covariance of all poses of the database.
    """
    dof = following.shape[1]
    mean = weights @ following
    spread = (following - mean) * np.sqrt(weights)[:, None] * settings.pose_widening
    covariance = spread.T @ spread
    if widening > 1:
        covariance += settings.background**2 * (widening**2 - 1) * everything
    covariance[np.arange(dof), np.arange(dof)] += (settings.pose_floor * widening) ** 2
    factor, _ = dpotrf(covariance, lower=1)
    precision, _ = dpotri(factor, lower=1)
    precision = np.tril(precision) + np.tril(precision, -1).T
    if last is None:
        return GaussianPrior(mean, precision)
    step = weights @ steps
    variance = settings.step_widening**2 * (weights @ (steps - step) ** 2) + (settings.step_floor * widening) ** 2
    both = precision.copy()
    both[np.arange(dof), np.arange(dof)] += 1 / variance
    information = precision @ mean + (last + step) / variance
    factor, _ = dpotrf(both, lower=1)
    centre, _ = dpotrs(factor, information, lower=1)
    return GaussianPrior(centre, both, 1 / variance)


def gather(
    rows: NDArray[np.int64], back: int, poses: NDArray[np.float32], headings: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Poses (K, D) of the rows `back` before `rows`, seen from the heading frames one row before `rows`."""
    out = np.empty((len(rows), poses.shape[1]))
    gather_kernel(rows, back, poses, headings, out)
    return out


@njit(cache=True)
def gather_kernel(rows, back, poses, headings, out):
    """See `gather`. The root's turn is exp(y yaw) exp(w), composed as quaternions."""
    for k in range(len(rows)):
        row, frame = rows[k] - back, rows[k] - 1
        for d in range(out.shape[1]):
            out[k, d] = poses[row, d]
        if row == frame:
            continue
        see_from(out[k], headings[row], headings[frame])


@njit(cache=True)
def see_from(q, own, other):
    """Changes q (D,), seen from heading frame `own` (3,), to what it is seen from `other` (3,), in place."""
    cosine, sine = np.cos(other[2]), np.sin(other[2])
    dx, dz = own[0] - other[0], own[1] - other[1]
    yaw = own[2] - other[2]
    c, s = np.cos(yaw), np.sin(yaw)
    x, z = q[0], q[2]
    q[0] = c * x + s * z + cosine * dx - sine * dz
    q[2] = c * z - s * x + sine * dx + cosine * dz
    a, b, e = q[3], q[4], q[5]
    angle = np.sqrt(a * a + b * b + e * e)
    scale = 0.5 if angle < 1e-9 else np.sin(angle / 2) / angle
    a, b, e, w = a * scale, b * scale, e * scale, np.cos(angle / 2)
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    a, b, e, w = c * a + s * e, c * b + s * w, c * e - s * a, c * w - s * b
    if w < 0:
        a, b, e, w = -a, -b, -e, -w
    sine = np.sqrt(a * a + b * b + e * e)
    scale = 2.0 if sine < 1e-9 else 2 * np.arctan2(sine, w) / sine
    q[3], q[4], q[5] = a * scale, b * scale, e * scale
