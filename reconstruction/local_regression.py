"""The paper's local regression (eq. 3-10): each degree of freedom predicted alone, along one direction.

With one output the matrix of eq. 8 has rank one, so that its eigenvector has a closed form: no eigen-decomposition a
degree of freedom. Taken to the letter, the inverse in eq. 8 (and 4) does not exist for K < m D neighbours; the
direction that eq. 5 asks for, of greatest squared relation to the output among those of unit length, is u ~ X^T D y.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class LocalRegression:
    """mean: (D,) a_d^T Q_{t,m} + beta; deviation: (D,) sigma_d, of eq. 10."""

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]


def history_weights(histories: NDArray[np.float64], query: NDArray[np.float64]) -> NDArray[np.float64]:
    """Eq. 7 with W = I: omega_k (K,) of histories (K, M) for Q_{t,m} (M,). Scaled to sum to one.

    The scale cancels in eq. 9 and 10, and subtracting the least distance first keeps all from vanishing.
    """
    squares = np.sum((histories - query) ** 2, axis=1)
    weights = np.exp(-0.5 * (squares - squares.min()))
    return weights / weights.sum()


def regress(
    histories: NDArray[np.float64],
    following: NDArray[np.float64],
    weights: NDArray[np.float64],
    query: NDArray[np.float64],
) -> LocalRegression:
    """Eq. 8-10 for all D outputs: from histories (K, M) and following poses (K, D) to the pose after query (M,)."""
    mean_x, mean_y = weights @ histories, weights @ following
    x, y = histories - mean_x, following - mean_y
    directions = x.T @ (weights[:, None] * y)
    directions /= np.maximum(np.linalg.norm(directions, axis=0), 1e-12)
    projections = x @ directions
    power = np.maximum(weights @ projections**2, 1e-18)
    gain = (weights @ (projections * y)) / power
    deviation = np.sqrt(weights @ (y - gain * projections) ** 2)
    return LocalRegression(mean_y + gain * ((query - mean_x) @ directions), deviation)
