"""The linearised fit against finite differences, and what it makes of moments made by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reconstruction.body_fit import _BEFORE_HABIT, BodyFit, FitPrior, Moment, Statement, _Linearisation, deviations
from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.rotations import exponential
from reconstruction.segments import NAMES, SEGMENTS, scaled
from reconstruction.similar_moments import trackers_kernel

PARAMETERS = len(NAMES) + 18


@pytest.fixture
def fit(database):
    spread = np.concatenate((np.full(len(NAMES), 0.1), np.full(18, 0.05)))
    mean = np.concatenate((np.ones(len(NAMES)), np.zeros(18)))
    return BodyFit(database, FitPrior(mean, spread, np.full(database.space.dof, 0.03)), 0.004, 0.05)


def trackers(fit, theta, q):
    """(6, 3) where the kernel puts the trackers of a body."""
    body, out = Body.of(fit.space.with_skeleton(fit.skeleton(theta))), np.empty((1, 6, 3))
    offsets = np.ascontiguousarray(theta[len(NAMES) :].reshape(6, 3))
    trackers_kernel(q[None], body.parents, body.offsets, body.mean, body.slots, fit.role_joints, offsets, out)
    return out[0]


def moment(fit, q, positions, turns=None, spread=0.05, legs=1.0):
    turns = np.full((6, 4), np.nan) if turns is None else turns
    mean = q.copy()
    mean[1] /= legs
    return Moment(positions, turns, np.zeros(3), mean, spread**2 * np.eye(len(q)))


def drawn(fit, seed=0):
    rng = np.random.default_rng(seed)
    theta = fit.prior.mean + 0.03 * rng.normal(size=PARAMETERS)
    q = rng.normal(0, 0.3, fit.space.dof)
    q[1] = 1.0
    return theta, q


def test_trackers_stand_where_the_body_has_them(fit):
    theta, q = drawn(fit)
    body = Body.of(fit.space.with_skeleton(fit.skeleton(theta)))
    state = BodyState.of(len(body.parents))
    place(body, q, state)
    offsets = theta[len(NAMES) :].reshape(6, 3)
    joints = fit.role_joints
    wanted = state.position[joints] + np.einsum("rab,rb->ra", state.world[joints], offsets)
    np.testing.assert_allclose(trackers(fit, theta, q), wanted, atol=1e-12)


def test_effects_are_the_derivatives(fit):
    theta, q = drawn(fit)
    seen = moment(fit, q, trackers(fit, theta, q), legs=fit.legs(theta))
    line = _Linearisation(fit, theta, np.full((6, 4), np.nan)).at(seen, q, np.zeros(len(q)))
    np.testing.assert_allclose(line.z, 0, atol=1e-9)
    for number in range(PARAMETERS):
        more, raised = theta.copy(), q.copy()
        more[number] += 1e-6
        raised[1] += seen.mean[1] * (fit.legs(more) - fit.legs(theta))
        moved = (trackers(fit, more, raised) - trackers(fit, theta, q)).ravel() / 1e-6
        np.testing.assert_allclose(line.effect[:, number], moved, atol=2e-4)
    for number in range(0, len(q), 5):
        bent = q.copy()
        bent[number] += 1e-6
        moved = (trackers(fit, theta, bent) - trackers(fit, theta, q)).ravel() / 1e-6
        np.testing.assert_allclose(line.effect[:, _BEFORE_HABIT + number], moved, atol=1e-4)


def test_turns_of_trackers_are_the_derivatives(fit):
    theta, q = drawn(fit, 1)
    turns = exponential(np.random.default_rng(2).normal(0, 0.5, (6, 3)))

    def measured(pose):
        body = Body.of(fit.space.with_skeleton(fit.skeleton(theta)))
        state = BodyState.of(len(body.parents))
        place(body, pose, state)
        return (Rotation.from_matrix(state.world[fit.role_joints]) * Rotation.from_quat(turns)).as_quat()

    still = _Linearisation(fit, theta, turns).at(
        moment(fit, q, trackers(fit, theta, q), measured(q), legs=fit.legs(theta)), q, np.zeros(len(q))
    )
    assert len(still.z) == 36
    np.testing.assert_allclose(still.z, 0, atol=1e-9)
    for number in range(3, len(q), 4):
        bent = q.copy()
        bent[number] += 1e-5
        line = _Linearisation(fit, theta, turns).at(
            moment(fit, q, trackers(fit, theta, bent), measured(bent), legs=fit.legs(theta)), q, np.zeros(len(q))
        )
        np.testing.assert_allclose(line.z / 1e-5, still.effect[:, _BEFORE_HABIT + number], atol=2e-3)


def test_known_poses_give_the_body_that_made_them(fit):
    rng = np.random.default_rng(3)
    theta = fit.prior.mean + np.concatenate((0.05 * rng.normal(size=len(NAMES)), 0.03 * rng.normal(size=18)))
    moments = []
    for _ in range(40):
        q = rng.normal(0, 0.4, fit.space.dof)
        q[1] = 1.0
        raised = q.copy()
        raised[1] *= fit.legs(theta)
        moments.append(moment(fit, q, trackers(fit, theta, raised), spread=1e-3))
    found = fit.fit(moments, (), None, 6)
    np.testing.assert_allclose(found.mounting.offsets,
                               theta[len(NAMES) :].reshape(6, 3), atol=0.004)  # fmt: skip
    made = fit.skeleton(theta).offsets
    np.testing.assert_allclose(scaled(fit.plain, found.scales).offsets, made, atol=0.01)
    known = deviations(found, fit.plain)
    assert set(known) == {*SEGMENTS, *("root", "head", "left_wrist", "right_wrist", "left_ankle", "right_ankle")}
    assert max(known.values()) < 0.02


def test_a_statement_is_kept(fit):
    row = np.zeros(PARAMETERS)
    row[0] = 1.0
    q = np.zeros(fit.space.dof)
    q[1] = 1.0
    found = fit.fit([moment(fit, q, np.full((6, 3), np.nan))], [Statement(row, 1.07, 1e-4)], None, 1)
    assert found.scales["stature"] == pytest.approx(1.07, abs=1e-3)
    assert np.isnan(found.residuals).all()
