import numpy as np
import pytest

from reconstruction.kinematics import world_joints
from reconstruction.pose_space import MeanRotations, facing
from reconstruction.rotations import about_up, multiply, rotate
from tests.reconstruction.conftest import strolling


@pytest.fixture
def motion():
    return strolling(3)


@pytest.fixture
def space(motion):
    means = MeanRotations(motion.skeleton)
    means.add(motion.rotations)
    return means.pose_space()


def test_coordinates_come_back_as_the_same_motion(space, motion):
    own = space.heading(motion.root_positions, motion.rotations[:, 0])
    q = space.coordinates(motion.root_positions, motion.rotations, own)
    back = space.motion(q, own, motion.fps, motion.name)
    before, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    after, _ = world_joints(motion.skeleton, back.root_positions, back.rotations)
    np.testing.assert_allclose(after, before, atol=1e-9)


def test_coordinates_do_not_change_when_the_world_turns(space, motion):
    turn = np.tile(about_up(np.array(1.3)), (len(motion), 1))
    rotations = motion.rotations.copy()
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    positions = rotate(turn, motion.root_positions) + np.array([4.0, 0, -2.0])
    here = space.coordinates(
        motion.root_positions, motion.rotations, space.heading(motion.root_positions, motion.rotations[:, 0])
    )
    there = space.coordinates(positions, rotations, space.heading(positions, rotations[:, 0]))
    np.testing.assert_allclose(there, here, atol=1e-9)


def test_own_heading_leaves_no_place_on_the_floor_and_no_yaw(space, motion):
    own = space.heading(motion.root_positions, motion.rotations[:, 0])
    q = space.coordinates(motion.root_positions, motion.rotations, own)
    np.testing.assert_allclose(q[:, [0, 2, 4]], 0, atol=1e-9)


def test_facing_follows_the_hips(motion):
    yaw = facing(motion.skeleton, about_up(np.array([0.0, 0.5, -2.0])))
    np.testing.assert_allclose(yaw, [0.0, 0.5, -2.0], atol=1e-12)


def test_joints_that_never_turn_are_left_out(space, motion):
    assert not motion.skeleton.is_end[space.moving].any()
    assert space.dof == 6 + 3 * len(space.moving)
