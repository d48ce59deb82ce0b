import numpy as np
import pytest

from devices.sample import ROLES
from reconstruction.kinematics import world_joints
from reconstruction.limb_poses import LimbPoses, LimbSettings, parts
from reconstruction.pose_statistics import PoseStatistics
from reconstruction.prediction import Observation
from reconstruction.window_features import seen_from


@pytest.fixture(scope="module")
def all_poses(database):
    return PoseStatistics.of_database(database, 1.0)


@pytest.fixture(scope="module")
def limbs(database, all_poses):
    return LimbPoses(database, 1.0, all_poses, LimbSettings())


def observed(database, row: int, measured: np.ndarray | None = None) -> Observation:
    """What trackers read at a row, seen from the heading frame one frame earlier."""
    joints = [database.space.skeleton.role_joint(role) for role in ROLES]
    motion = database.motion(database.clip_of(row))
    at = slice(row - database.clip_of(row).first, row - database.clip_of(row).first + 1)
    world = world_joints(motion.skeleton, motion.root_positions[at], motion.rotations[at])[0][:, joints]
    trackers = seen_from(world, np.zeros((1, 3)), database.headings[row - 1].astype(np.float64)[None])[0]
    return Observation(trackers) if measured is None else Observation(trackers, measured)


def test_every_angle_is_in_one_part_but_for_the_turn_about_up(database):
    found = parts(database.space.skeleton, database.space.moving)
    coordinates = np.concatenate([own for own, _, _ in found])
    assert sorted(coordinates) == [3, 5, *range(6, database.space.dof)]
    by_roles = {tuple(ROLES[role] for role in roles): own for own, roles, _ in found}
    assert {roles for roles in by_roles if len(roles) == 1} == {(role,) for role in ROLES if role != "root"}
    moving = [database.space.skeleton.names[joint] for joint in database.space.moving]
    left = {moving[(c - 6) // 3] for c in by_roles[("left_wrist",)]}
    assert {"LeftArm", "LeftForeArm", "LeftHand"} <= left
    assert not any(name.startswith("Right") for name in left)


def test_a_pose_of_the_data_is_told_better_by_its_limbs_than_by_all_poses(database, limbs, all_poses):
    off = []
    for row in range(200, 1600, 100):
        said = limbs.statement(observed(database, row), 1.0, 1.0)
        free = np.flatnonzero(said.precision.any(axis=0))
        mean = np.linalg.solve(said.precision[np.ix_(free, free)], said.information[free])
        truth = database.poses[row][free]
        off.append((np.abs(mean - truth).mean(), np.abs(all_poses.mean[free] - truth).mean()))
    ours, others = np.mean(off, axis=0)
    assert ours < 0.5 * others


def test_parts_are_independent_and_the_root_is_free(database, limbs):
    said = limbs.statement(observed(database, 400), 1.0, 1.0)
    together = np.zeros((database.space.dof,) * 2, np.bool_)
    for own, _, _ in parts(database.space.skeleton, database.space.moving):
        together[np.ix_(own, own)] = True
    assert not said.precision[~together].any()
    assert not said.information[[0, 1, 2, 4]].any()
    np.testing.assert_allclose(said.precision, said.precision.T, rtol=1e-9)
    assert np.linalg.eigvalsh(said.precision).min() > -1e-9


def test_a_limb_without_its_tracker_is_as_in_all_poses(database, limbs, all_poses):
    measured = np.array([role != "left_wrist" for role in ROLES])
    seen = observed(database, 400)
    whole = limbs.statement(seen, 0.5, 0.0)
    without = limbs.statement(Observation(seen.trackers, measured), 0.5, 0.25)
    for own, roles, _ in parts(database.space.skeleton, database.space.moving):
        block = np.ix_(own, own)
        if measured[roles].all():
            np.testing.assert_array_equal(whole.precision[block], without.precision[block])
        else:
            plain = 0.25 * np.linalg.inv(all_poses.covariance[block] + PoseStatistics.FLOOR**2 * np.eye(len(own)))
            np.testing.assert_allclose(without.precision[block], plain, rtol=1e-9)
            np.testing.assert_allclose(without.information[own], plain @ all_poses.mean[own], rtol=1e-9)
