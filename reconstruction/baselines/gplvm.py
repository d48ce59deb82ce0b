"""A scaled Gaussian process latent variable model of poses: Grochow et al. 2004, after Lawrence 2004.

Kernel k(x, x') = alpha exp(-gamma / 2 ||x - x'||^2) + delta / beta; objective, their eq. 5:

    L = D/2 ln|K| + 1/2 sum_d w_d^2 y_d^T K^-1 y_d + 1/2 sum ||x_i||^2 + ln(alpha beta gamma) - N sum_d ln w_d
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

LEAST_SCALE = 0.01
"""Radians (metres): a degree of freedom that hardly moves is not scaled up further than this."""


@dataclass(frozen=True, eq=False)
class PoseModel:
    """A learned model of N active poses y (N, D) with latents x (N, Q).

    mean: (D,) taken off y; weights: (D,) the scales w_d; inverse: (N, N) K^-1; projection: (N, D) K^-1 (y - mean).
    kernel: alpha, beta, gamma.
    """

    latents: NDArray[np.float64]
    mean: NDArray[np.float64]
    weights: NDArray[np.float64]
    inverse: NDArray[np.float64]
    projection: NDArray[np.float64]
    kernel: NDArray[np.float64]

    def pose(self, latent: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """f(x): mean pose (D,) and variance sigma^2(x) of the scaled features, their eq. 7-8, at one latent (Q,)."""
        alpha, beta, gamma = self.kernel
        near = alpha * np.exp(-0.5 * gamma * ((self.latents - latent) ** 2).sum(axis=1))
        variance = alpha + 1 / beta - near @ self.inverse @ near
        return self.mean + near @ self.projection, max(float(variance), 1e-6)


def learned(poses: NDArray[np.float64], latent_dimensions: int, rounds: int = 4, iterations: int = 25) -> PoseModel:
    """The model of active poses (N, D), its latents started from the principal components.

    rounds: of `iterations` L-BFGS steps over latents and kernel, between which the scales take their optimum
    w_d^2 = N / (y_d^T K^-1 y_d).
    """
    mean = poses.mean(axis=0)
    y = poses - mean
    weights = 1 / np.maximum(y.std(axis=0), LEAST_SCALE)
    latents = _principal(y * weights, latent_dimensions)
    packed = np.concatenate([latents.ravel(), np.log([1.0, 100.0, 1.0])])
    options = {"maxiter": iterations}
    for _ in range(rounds):
        found = minimize(
            objective, packed, (y * weights, latent_dimensions), jac=True, method="L-BFGS-B", options=options
        )
        packed = found.x
        inverse = _kernel_inverse(packed, latent_dimensions)
        weights = np.sqrt(len(y) / np.maximum(np.einsum("nd,nm,md->d", y, inverse, y), 1e-9))
        weights = np.minimum(weights, 1 / LEAST_SCALE)
    latents, kernel = _unpacked(packed, latent_dimensions)
    inverse = _kernel_inverse(packed, latent_dimensions)
    return PoseModel(latents, mean, weights, inverse, inverse @ y, kernel)


def _kernel_inverse(packed: NDArray[np.float64], dimensions: int) -> NDArray[np.float64]:
    return _inverse(_covariance(*_unpacked(packed, dimensions))[0])[0]


def objective(
    packed: NDArray[np.float64], scaled: NDArray[np.float64], latent_dimensions: int
) -> tuple[float, NDArray[np.float64]]:
    """L and its gradient at packed latents and log kernel (N Q + 3,), for poses scaled by w (N, D); w is held."""
    latents, kernel = _unpacked(packed, latent_dimensions)
    _, beta, gamma = kernel
    covariance, smooth, squares = _covariance(latents, kernel)
    inverse, log_determinant = _inverse(covariance)
    explained = inverse @ scaled
    dof = scaled.shape[1]
    value = 0.5 * (dof * log_determinant + np.sum(scaled * explained) + np.sum(latents**2)) + np.log(kernel).sum()
    pull = 0.5 * (dof * inverse - explained @ explained.T)
    weighted = pull * smooth
    of_latents = 2 * -gamma * (weighted.sum(axis=1)[:, None] * latents - weighted @ latents) + latents
    of_kernel = np.array([weighted.sum(), -np.trace(pull) / beta, -0.5 * gamma * np.sum(weighted * squares)]) + 1
    return float(value), np.concatenate([of_latents.ravel(), of_kernel])


def spread_out(features: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Indices of at most `count` rows of (N, D) far from each other: the active set, by farthest-point sampling."""
    chosen = [int(np.argmin(((features - features.mean(axis=0)) ** 2).sum(axis=1)))]
    nearest = np.full(len(features), np.inf)
    while len(chosen) < min(count, len(features)):
        nearest = np.minimum(nearest, ((features - features[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(nearest.argmax()))
    return np.array(chosen)


def _unpacked(packed: NDArray[np.float64], dimensions: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return packed[:-3].reshape(-1, dimensions), np.exp(np.clip(packed[-3:], -12, 12))


def _covariance(
    latents: NDArray[np.float64], kernel: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """K (N, N), its part without noise, and the squared latent distances."""
    alpha, beta, gamma = kernel
    sizes = (latents**2).sum(axis=1)
    squares = np.maximum(sizes[:, None] + sizes - 2 * latents @ latents.T, 0.0)
    smooth = alpha * np.exp(-0.5 * gamma * squares)
    return smooth + (1 / beta + 1e-8) * np.eye(len(latents)), smooth, squares


def _inverse(covariance: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    factor = cho_factor(covariance, lower=True)
    inverse = cho_solve(factor, np.eye(len(covariance)))
    return inverse, 2 * float(np.log(np.diag(factor[0])).sum())


def _principal(scaled: NDArray[np.float64], dimensions: int) -> NDArray[np.float64]:
    u, s, _ = np.linalg.svd(scaled - scaled.mean(axis=0), full_matrices=False)
    scores = u[:, :dimensions] * s[:dimensions]
    return scores / max(float(scores[:, 0].std()), 1e-9)
