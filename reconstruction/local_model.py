"""The default prior: what the neighbours say of this pose, and of the step to it, as one Gaussian.

Where the paper predicts every degree of freedom alone (`local_regression`), this keeps how they vary together among
the neighbours, so that a tracker pulls a whole arm as arms move. Two statements are multiplied:

- pose: q_t ~ N(weighted mean of the neighbours' y_k, their covariance plus a floor);
- step: q_t ~ N(q_{t-1} + weighted mean of y_k - x_k, the steps' spread plus a floor), which carries what the trackers
  do not see, and damps jitter.

Neighbours that are far differ from the truth by more than from each other, and in other ways: then the covariance of
all poses of the database, in proportion to the squared distance, is added to the first, and both floors rise. Farther
still, a third statement sets in, which holds a body together that nothing else does: that each limb, by itself, is
held as it often is (`limb_poses`).

With few trackers the last pose is less sure than the neighbours are: the fewer, the more the first statement counts.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs

from devices.sample import ROLES
from reconstruction.limb_poses import LimbSettings, Statement
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
    doubt_from, doubt_full: widenings at which the third statement sets in, and from which on it counts in full.
    later: how much more widening it takes where a limb's tracker is missing, 0 or more.
    trust: how much the first statement counts with six trackers, above 0; with n it is (6 / n)^few_trust times that.
    limbs: how the nearest limbs become the third.
    """

    pose_floor: float = 0.02
    step_floor: float = 0.022
    pose_widening: float = 1.35
    step_widening: float = 5.0
    background: float = 0.2
    doubt_from: float = 1.0
    doubt_full: float = 3.0
    later: float = 0.75
    trust: float = 0.75
    few_trust: float = 0.45
    limbs: LimbSettings = field(default_factory=LimbSettings)

    def doubt(self, widening: float) -> tuple[float, float]:
        """0 to 1: how much the third statement counts, of limbs whose trackers are there and of those without."""
        since = widening - self.doubt_from - np.array([0.0, self.later])
        here, gone = np.clip(since / (self.doubt_full - self.doubt_from), 0.0, 1.0)
        return float(here), float(gone)

    def trusted(self, trackers: int) -> float:
        """How much the first statement counts with so many trackers."""
        return self.trust * (len(ROLES) / max(trackers, 1)) ** self.few_trust


def local_prior(
    following: NDArray[np.float64],
    steps: NDArray[np.float64],
    weights: NDArray[np.float64],
    last: NDArray[np.float64] | None,
    widening: float,
    all_poses: NDArray[np.float64],
    limbs: Statement | None,
    trackers: int,
    settings: LocalModelSettings,
) -> GaussianPrior:
    """The prior from K neighbours.

    following: (K, D), y_k; steps: (K, D), y_k - x_k; weights: (K,), summing to one; last: (D,) q_{t-1} or None where
    there is no history; widening: 1 inside the data, in proportion to the neighbours' distance outside;
    all_poses: (D, D), the covariance of all poses of the database; limbs: the third statement, None where there is no
    doubt; trackers: how many were measured.
    """
    dof = following.shape[1]
    mean = weights @ following
    spread = (following - mean) * np.sqrt(weights)[:, None] * settings.pose_widening
    covariance = spread.T @ spread
    if widening > 1:
        covariance += settings.background**2 * (widening**2 - 1) * all_poses
    covariance[np.arange(dof), np.arange(dof)] += (settings.pose_floor * widening) ** 2
    factor, _ = dpotrf(covariance, lower=1)
    precision, _ = dpotri(factor, lower=1)
    precision = settings.trusted(trackers) * (np.tril(precision) + np.tril(precision, -1).T)
    information = precision @ mean
    if limbs is not None:
        precision += limbs.precision
        information += limbs.information
    if last is None:
        return GaussianPrior(_mean(precision, information), precision)
    step = weights @ steps
    variance = settings.step_widening**2 * (weights @ (steps - step) ** 2) + (settings.step_floor * widening) ** 2
    both = precision.copy()
    both[np.arange(dof), np.arange(dof)] += 1 / variance
    return GaussianPrior(_mean(both, information + (last + step) / variance), both, 1 / variance, last + step)


def _mean(precision: NDArray[np.float64], information: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean (D,) of a Gaussian by its precision (D, D) and their product."""
    factor, _ = dpotrf(precision, lower=1)
    return dpotrs(factor, information, lower=1)[0]
