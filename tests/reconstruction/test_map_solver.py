from dataclasses import replace

import numpy as np
import pytest
from numba import typeof
from scipy.optimize import approx_fprime, least_squares

from devices.sample import ROLES
from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.likelihood import Effectors, jacobian, residuals
from reconstruction.map_problem import GaussianPrior, MapProblem
from reconstruction.map_solver import MapSolver, energy_kernel
from tests.reconstruction.test_likelihood import BODY, SPACE, placed

DOF = SPACE.dof


def problem(seed: int, limit: float = np.inf) -> MapProblem:
    """Six trackers some centimetres off the prior's mean; correlated coordinates."""
    rng = np.random.default_rng(seed)
    mean = rng.normal(0, 0.3, DOF)
    joints = np.array([SPACE.skeleton.role_joint(role) for role in ROLES])
    where = placed(mean).position[joints]
    e = Effectors(joints, np.zeros((6, 3)), where + rng.normal(0, 0.03, where.shape), np.full(6, 1 / 0.003))
    spread = rng.normal(0, 0.02, (DOF, 30))
    precision = np.linalg.inv(spread @ spread.T + 0.02**2 * np.eye(DOF))
    prior = GaussianPrior(mean, (precision + precision.T) / 2)
    return MapProblem(BODY, prior, e, mean - limit, mean + limit)


def oracle(p: MapProblem) -> np.ndarray:
    root = np.linalg.cholesky(p.prior.precision).T

    def all_residuals(q: np.ndarray) -> np.ndarray:
        state = BodyState.of(len(BODY.parents))
        place(BODY, q, state)
        return np.concatenate((root @ (q - p.prior.mean), residuals(p.effectors, state)))

    bounds = (p.lower, p.upper) if np.isfinite(p.lower).all() else (-np.inf, np.inf)
    return least_squares(all_residuals, p.prior.mean, bounds=bounds, xtol=1e-12, ftol=1e-12).x


@pytest.mark.parametrize("seed", range(5))
def test_finds_the_optimum_that_least_squares_finds(seed):
    p = problem(seed)
    found = MapSolver(BODY, DOF).solve(p, p.prior.mean)
    best = p.energy(oracle(p))
    assert found.energy == pytest.approx(p.energy(found.q), rel=1e-9)
    assert best * (1 - 1e-9) <= found.energy <= best * 1.002 + 1e-6
    assert found.evaluations < 60


@pytest.mark.parametrize("seed", range(3))
def test_keeps_joint_limits_and_is_optimal_among_them(seed):
    p = problem(seed, limit=0.03)
    found = MapSolver(BODY, DOF).solve(p, p.prior.mean)
    assert found.limited
    assert (found.q >= p.lower).all()
    assert (found.q <= p.upper).all()
    assert found.energy <= p.energy(oracle(p)) * 1.05
    assert found.energy > p.energy(MapSolver(BODY, DOF).solve(problem(seed), p.prior.mean).q)


def test_the_problems_gradient_is_its_derivative():
    p = problem(7)
    q = p.prior.mean + 0.01
    np.testing.assert_allclose(p.gradient(q), approx_fprime(q, p.energy, 1e-8), rtol=1e-3, atol=0.5)


def test_the_covariance_is_the_inverse_of_the_curvature():
    p = problem(1)
    root = MapSolver(BODY, DOF).covariance_root(p, p.prior.mean)
    j = jacobian(BODY, p.effectors, placed(p.prior.mean), DOF)
    np.testing.assert_allclose(root @ root.T @ (p.prior.precision + j.T @ j), np.eye(DOF), atol=1e-6)


def test_solving_twice_gives_the_same_bits():
    p = problem(2)
    solver = MapSolver(BODY, DOF)
    assert (solver.solve(p, p.prior.mean).q == solver.solve(p, p.prior.mean).q).all()


def test_limits_compile_no_second_kernel():
    p = problem(0)
    MapSolver(BODY, DOF).solve(p, p.prior.mean)
    before = list(energy_kernel.signatures)
    p = problem(0, limit=0.03)
    assert MapSolver(BODY, DOF).solve(p, p.prior.mean).limited
    assert energy_kernel.signatures == before


def test_the_kernels_see_every_skeleton_as_the_same_types():
    read_only = SPACE.skeleton.offsets.copy()
    read_only.flags.writeable = False
    columns_first = np.asfortranarray(SPACE.skeleton.offsets)
    skeletons = [replace(SPACE.skeleton, offsets=offsets) for offsets in (read_only, columns_first)]
    types = [kernel_types(Body.of(SPACE.with_skeleton(skeleton))) for skeleton in (SPACE.skeleton, *skeletons)]
    assert types[0] == types[1] == types[2]


def kernel_types(body: Body) -> list:
    return [typeof(array) for array in (body.parents, body.offsets, body.mean, body.slots)]
