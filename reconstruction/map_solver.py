"""Solves MAP problems with NLopt: the one file that knows it.

The paper uses Levenberg-Marquardt; here it is NLopt's L-BFGS on whitened coordinates. With H = precision + J^T J at
the start and H = L L^T, the variables are v = L^T (q - start): the energy's Hessian is near the identity, so that the
first step is a Gauss-Newton step and few follow. Whitening turns joint limits into general constraints, so where the
free optimum breaks a limit the problem is solved again in q divided by its posterior deviation, with the limits as
NLopt's bounds.
"""

from contextlib import suppress
from dataclasses import dataclass

import nlopt
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtri

from reconstruction.body_kinematics import Body, BodyState, place, place_kernel
from reconstruction.likelihood import gradient_kernel, jacobian
from reconstruction.map_problem import MapProblem


@dataclass(frozen=True, eq=False)
class MapSolution:
    """The most probable pose.

    q: (D,); energy: at q; evaluations: of the energy; limited: whether a joint limit holds it.
    """

    q: NDArray[np.float64]
    evaluations: int
    energy: float
    limited: bool


class MapSolver:
    """Solves problems of one body, D coordinates, reusing its room and its NLopt optimisers."""

    TOLERANCE = 1e-4
    """Relative decrease of the energy (of order 1 to D) at which to stop."""
    MOST_EVALUATIONS = 20
    """After so many it whitens anew, where it stands, ..."""
    MOST_FREE = 80
    """... up to so many: a handful does near the prior's mean, but far from it the curvature changes."""

    MOST_BOUNDED = 200
    """Evaluations where limits hold the pose: scaled only, not whitened, they need more."""

    def __init__(self, body: Body, dof: int):
        self.body = body
        self._state = BodyState.of(len(body.parents))
        self._wrench = np.empty((len(body.parents), 6))
        self._room = np.empty((2, dof))
        self._free = self._optimiser(dof, self.MOST_EVALUATIONS)
        self._bounded = self._optimiser(dof, self.MOST_BOUNDED)

    def _optimiser(self, dof: int, most_evaluations: int) -> nlopt.opt:
        optimiser = nlopt.opt(nlopt.LD_LBFGS, dof)
        optimiser.set_ftol_rel(self.TOLERANCE)
        optimiser.set_maxeval(most_evaluations)
        optimiser.set_vector_storage(8)
        return optimiser

    def solve(self, problem: MapProblem, start: NDArray[np.float64]) -> MapSolution:
        """The optimum nearest to `start` (D,). Deterministic."""
        root = self.covariance_root(problem, start)
        q, evaluations, energy = self._minimise(self._free, problem, start, root)
        while evaluations % self.MOST_EVALUATIONS == 0 and evaluations < self.MOST_FREE:
            root = self.covariance_root(problem, q)
            q, more, energy = self._minimise(self._free, problem, q, root)
            evaluations += more
        outside = (q < problem.lower) | (q > problem.upper)
        if not outside.any():
            return MapSolution(q, evaluations, energy, False)
        deviation = np.sqrt(np.einsum("ij,ij->i", root, root))
        start = np.clip(q, problem.lower, problem.upper)
        self._bounded.set_lower_bounds((problem.lower - start) / deviation)
        self._bounded.set_upper_bounds((problem.upper - start) / deviation)
        q, more, energy = self._minimise(self._bounded, problem, start, np.diag(deviation))
        q = np.clip(q, problem.lower, problem.upper)
        return MapSolution(q, evaluations + more, energy, True)

    def covariance_root(self, problem: MapProblem, start: NDArray[np.float64]) -> NDArray[np.float64]:
        """C (D, D), upper triangular, with C C^T = (precision + J^T J)^-1 at the start: Laplace's covariance of the
        posterior, where the start is the optimum."""
        place(self.body, start, self._state)
        j = jacobian(self.body, problem.effectors, self._state, len(start))
        lower, _ = dpotrf(problem.prior.precision + j.T @ j, lower=1, clean=1)
        inverse, _ = dtrtri(lower, lower=1)
        return np.ascontiguousarray(inverse.T)

    def _minimise(
        self, optimiser: nlopt.opt, problem: MapProblem, start: NDArray[np.float64], root: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], int, float]:
        """Minimises over v in q = start + root v, from v = 0."""
        b, e, p, s = self.body, problem.effectors, problem.prior, self._state
        best = [np.inf, np.zeros(len(start))]
        count = 0

        def energy(v: NDArray[np.float64], gradient: NDArray[np.float64]) -> float:
            nonlocal count
            count += 1
            value = energy_kernel(
                v, root, start, p.mean, p.precision, b.parents, b.offsets, b.mean, b.slots,
                e.joints, e.offsets, e.targets, e.weights,
                s.position, s.world, s.turn, self._wrench, self._room, gradient,
            )  # fmt: skip
            if value < best[0]:
                best[0], best[1] = value, v.copy()
            return value

        optimiser.set_min_objective(energy)
        # A line search that can go no lower raises: the best point seen is the answer then too.
        with suppress(nlopt.RoundoffLimited, nlopt.runtime_error, RuntimeError):
            optimiser.optimize(np.zeros(len(start)))
        return start + root @ best[1], count, float(best[0])


@njit(cache=True)
def energy_kernel(
    v, root, start, prior_mean, precision, parents, offsets, mean, slots,
    joints, points, targets, weights, position, world, turn, wrench, room, gradient,
):  # fmt: skip
    """E_prior + E_likelihood at q = start + root v and, where asked for, its gradient with respect to v.

    room: (2, D), for q and the gradient with respect to q.
    """
    q, g = room[0], room[1]
    q[:] = start + np.dot(root, v)
    place_kernel(q, parents, offsets, mean, slots, position, world, turn)
    value = gradient_kernel(joints, points, targets, weights, parents, slots, position, world, turn, wrench, g)
    off = q - prior_mean
    pull = np.dot(precision, off)
    value += 0.5 * np.dot(off, pull)
    if len(gradient) > 0:
        g += pull
        gradient[:] = np.dot(root.T, g)
    return value
