import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime

from reconstruction.body_kinematics import Body, BodyState, joint_positions, place
from reconstruction.kinematics import world_joints
from reconstruction.likelihood import Effectors, energy_and_gradient, jacobian, residuals
from reconstruction.pose_space import MeanRotations
from tests.reconstruction.conftest import strolling

MOTION = strolling(5, 40)
MEANS = MeanRotations(MOTION.skeleton)
MEANS.add(MOTION.rotations)
SPACE = MEANS.pose_space()
BODY = Body.of(SPACE)


def pose(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 0.7, SPACE.dof)


def effectors(seed: int) -> Effectors:
    rng = np.random.default_rng(seed)
    joints = rng.integers(0, len(BODY.parents), 8)
    return Effectors(joints, rng.normal(0, 0.1, (8, 3)), rng.normal(0, 1, (8, 3)), rng.uniform(0.5, 3, 8))


def placed(q: np.ndarray) -> BodyState:
    state = BodyState.of(len(BODY.parents))
    place(BODY, q, state)
    return state


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_the_kernel_places_joints_as_plain_forward_kinematics_does(seed):
    q, heading = pose(seed), np.zeros(3)
    state = placed(q)
    position, world = world_joints(
        SPACE.skeleton, SPACE.root_positions(q[None], heading), SPACE.rotations(q[None], heading)
    )
    np.testing.assert_allclose(state.position, position[0], atol=1e-12)
    np.testing.assert_allclose(state.world, world[0], atol=1e-12)
    np.testing.assert_allclose(joint_positions(BODY, q[None])[0], position[0], atol=1e-12)


@pytest.mark.parametrize("scale", [1.0, 1e-5, 0.0])
def test_the_gradient_is_the_derivative_also_near_zero_turns(scale):
    q, e = scale * pose(1), effectors(2)
    gradient, state = np.empty(SPACE.dof), placed(q)
    value = energy_and_gradient(BODY, e, q, state, gradient)
    np.testing.assert_allclose(value, 0.5 * np.sum(residuals(e, state) ** 2), rtol=1e-12)
    numeric = approx_fprime(q, lambda p: 0.5 * np.sum(residuals(e, placed(p)) ** 2), 1e-7)
    np.testing.assert_allclose(gradient, numeric, atol=2e-4)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000))
def test_the_gradient_is_the_jacobian_times_the_residuals(seed):
    q, e = pose(seed), effectors(seed + 1)
    gradient, state = np.empty(SPACE.dof), placed(q)
    energy_and_gradient(BODY, e, q, state, gradient)
    by_jacobian = jacobian(BODY, e, state, SPACE.dof).T @ residuals(e, state)
    np.testing.assert_allclose(gradient, by_jacobian, atol=1e-9)
