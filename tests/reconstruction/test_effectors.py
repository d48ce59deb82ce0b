import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.effectors import Measurement, and_lost, effectors
from reconstruction.kinematics import world_joints
from reconstruction.likelihood import residuals
from reconstruction.mounting import Mounting
from reconstruction.solver import reconstruct
from reconstruction.solver_settings import SolverSettings
from tests.reconstruction.conftest import strolling
from tests.reconstruction.test_likelihood import MOTION, SPACE, placed
from tests.reconstruction.test_solver import UNSEEN, errors_cm

ROLE_JOINTS = np.array([MOTION.skeleton.role_joint(role) for role in ROLES])
WORN = Mounting(
    np.random.default_rng(1).normal(0, 0.04, (6, 3)), Rotation.random(6, np.random.default_rng(2)).as_quat()
)


def readings(motion, mounting: Mounting) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, 6, 3) and orientations (T, 6, 4) of trackers worn like that."""
    joints, world = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    roles = [motion.skeleton.role_joint(role) for role in ROLES]
    where = joints[:, roles] + np.einsum("trab,rb->tra", world[:, roles], mounting.offsets)
    turned = world[:, roles] @ Rotation.from_quat(mounting.rotations).as_matrix()
    return where, Rotation.from_matrix(turned.reshape(-1, 3, 3)).as_quat().reshape(*where.shape[:2], 4)


def frames_of(positions, orientations, roles=ROLES) -> list[TrackerFrame]:
    return [
        TrackerFrame.from_positions(
            n / 60, {r: p[ROLES.index(r)] for r in roles}, {r: o[ROLES.index(r)] for r in roles}
        )
        for n, (p, o) in enumerate(zip(positions, orientations, strict=True))
    ]


def test_a_pose_that_was_measured_leaves_no_residual():
    where, turned = readings(MOTION, WORN)
    heading = SPACE.heading(MOTION.root_positions[7], MOTION.rotations[7, 0])
    q = SPACE.coordinates(MOTION.root_positions[7:8], MOTION.rotations[7:8], heading)[0]
    found = effectors(Measurement(where[7], turned[7], 0.002, 0.03), ROLE_JOINTS, WORN, heading)
    assert len(found) == 24
    np.testing.assert_allclose(residuals(found, placed(q)), 0, atol=1e-8)


def test_missing_orientations_and_positions_count_for_nothing():
    where, turned = readings(MOTION, WORN)
    where[0, 1], turned[0, 4] = np.nan, np.nan
    found = effectors(Measurement(where[0], turned[0], 0.002, 0.03), ROLE_JOINTS, WORN, np.zeros(3))
    assert len(found) == 5 + 3 * 4
    assert np.isfinite(found.targets).all()


@pytest.mark.parametrize("roles", [ROLES, ROLES[2:]])
def test_orientations_help(database, roles):
    frames = frames_of(*readings(UNSEEN, WORN), roles)
    with_them = reconstruct(frames, database, mounting=WORN).motion
    without = reconstruct(frames, database, settings=SolverSettings(orientations=False), mounting=WORN).motion
    angles = [
        np.mean((Rotation.from_quat(m.rotations.reshape(-1, 4)).inv() * truth).magnitude())
        for truth in [Rotation.from_quat(UNSEEN.rotations.reshape(-1, 4))]
        for m in (with_them, without)
    ]
    assert angles[0] < angles[1]
    assert errors_cm(UNSEEN, with_them).mean() < errors_cm(UNSEEN, without).mean()


def test_orientations_of_an_unknown_mounting_do_no_harm(database):
    at_joints = Mounting(np.zeros((6, 3)), WORN.rotations)
    motion = strolling(51, 60)
    frames = frames_of(*readings(motion, at_joints))
    found = reconstruct(frames, database).motion
    plain = reconstruct(frames, database, settings=SolverSettings(orientations=False)).motion
    assert errors_cm(motion, found).mean() < 1.3 * errors_cm(motion, plain).mean() + 0.1


def test_lost_trackers_fade_and_those_never_seen_do_not_count():
    where, _ = readings(MOTION, WORN)
    positions = where[0].copy()
    positions[3:] = np.nan
    seen = effectors(Measurement(positions, np.full((6, 4), np.nan), 0.002, 0.1), ROLE_JOINTS, WORN, np.zeros(3))
    known = and_lost(seen, np.array([0, 0, 0, 0.1, 2.0, np.inf]), 0.3, ROLE_JOINTS, WORN)
    np.testing.assert_array_equal(known.joints, ROLE_JOINTS[:5])
    np.testing.assert_array_equal(known.offsets, WORN.offsets[:5])
    np.testing.assert_allclose(known.weights, [500, 500, 500, 1 / 0.03, 1 / 0.6])
