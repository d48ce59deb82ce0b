"""The MAP problem of one frame (paper eq. 1-2, with arg min): a Gaussian prior, a likelihood and joint limits.

Built here, solved in `map_solver`: a test can look at the problem without solving it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotrs

from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.likelihood import Effectors, energy_and_gradient, residuals


@dataclass(frozen=True, eq=False)
class GaussianPrior:
    """p(q_t | Q_{t,m}) = N(mean, precision^-1).

    mean: (D,); precision: (D, D), symmetric positive definite; from_last: (D,) what of its diagonal the last pose alone
    gives, or None where that is not told apart; going_on: (D,) where the last pose alone leads to.
    """

    mean: NDArray[np.float64]
    precision: NDArray[np.float64]
    from_last: NDArray[np.float64] | None = None
    going_on: NDArray[np.float64] | None = None

    @property
    def without_last(self) -> "GaussianPrior":
        """What it would be of a pose whose last one is not known."""
        if self.from_last is None or self.going_on is None:
            return self
        precision = self.precision - np.diag(self.from_last)
        factor, _ = dpotrf(precision, lower=1)
        mean, _ = dpotrs(factor, self.precision @ self.mean - self.from_last * self.going_on, lower=1)
        return GaussianPrior(mean, precision)

    def energy(self, q: NDArray[np.float64]) -> float:
        """E_prior, up to a constant."""
        off = q - self.mean
        return float(0.5 * off @ self.precision @ off)

    def gradient(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """(D,) derivative of the energy."""
        return self.precision @ (q - self.mean)


@dataclass(frozen=True, eq=False)
class MapProblem:
    """Minimise E_prior(q) + E_likelihood(q) subject to lower <= q <= upper.

    lower, upper: (D,) joint limits; infinite for the root.
    """

    body: Body
    prior: GaussianPrior
    effectors: Effectors
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]

    def energy(self, q: NDArray[np.float64]) -> float:
        """The sum of both terms: the plain reference of `map_solver`'s kernel."""
        state = BodyState.of(len(self.body.parents))
        place(self.body, q, state)
        return self.prior.energy(q) + float(0.5 * np.sum(residuals(self.effectors, state) ** 2))

    def gradient(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """(D,) derivative of the energy."""
        out = np.empty(len(q))
        energy_and_gradient(self.body, self.effectors, q, BodyState.of(len(self.body.parents)), out)
        return out + self.prior.gradient(q)
