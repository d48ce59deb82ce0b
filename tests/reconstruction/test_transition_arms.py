"""Arms stay out of the body on the way, and only there."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.rotations import exponential, multiply
from reconstruction.transition import prepared
from reconstruction.transition.arms_clear import arm_depths_kernel, body_capsules, cleared_arms, nearest_between
from reconstruction.transition.footwork import Step, kept_apart
from reconstruction.transition.world_joints_kernel import joint_positions_kernel

from .moving_bodies import standing


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_depth_is_radii_less_the_distance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    joints = rng.normal(0, 1, (1, 5, 3))
    arms, segments, radii = np.array([[0, 1, 2]]), np.array([[3, 4]]), np.array([0.2, 0.1])
    depth, outwards, _ = arm_depths_kernel(joints, arms, segments, radii)
    assert 0.3 - depth[0, 0] == pytest.approx(nearest_between(*joints[0, 1:]), abs=0.02)
    assert np.linalg.norm(outwards[0, 0]) == pytest.approx(1)


def test_a_forearm_that_cuts_through_the_trunk_goes_round_it() -> None:
    motion = standing(41)
    skeleton, rotations = motion.skeleton, motion.rotations.copy()
    arm = skeleton.names.index("LeftArm")
    inward = np.sin(np.linspace(0, np.pi, 41))[:, None] ** 2
    rotations[:, arm] = multiply(exponential(inward * (0.0, 0.0, -0.7)), rotations[:, arm])
    capsules = body_capsules(skeleton)

    def depth(turns: np.ndarray) -> np.ndarray:
        joints, _ = joint_positions_kernel(skeleton.parents, skeleton.offsets, motion.root_positions, turns)
        return arm_depths_kernel(joints, *capsules)[0]

    assert depth(rotations).max() > 0.03
    cleared = cleared_arms(skeleton, motion.root_positions, rotations, capsules, motion.fps)
    assert depth(cleared).max() < 0.5 * depth(rotations).max()
    np.testing.assert_allclose(cleared[[0, -1]], rotations[[0, -1]], atol=1e-12)
    others = [j for j in range(len(skeleton)) if j != arm]
    np.testing.assert_array_equal(cleared[:, others], rotations[:, others])


def test_arms_that_are_clear_are_left_alone() -> None:
    clip = prepared(standing(20, arms=0.6))
    same = cleared_arms(clip.skeleton, clip.motion.root_positions, clip.motion.rotations, clip.capsules, 60.0)
    assert same is clip.motion.rotations


def test_feet_pass_each_other_apart() -> None:
    t = np.linspace(0, 1, 41)
    paths = np.zeros((41, 2, 3))
    paths[:, 0] = 0.1, 0, 0
    paths[:, 1, 0] = 0.25 - 0.35 * t
    apart = kept_apart(paths, [Step(0, 1, 0), Step(0, 1, 0)], np.array([1.0, 0, 0]), t)
    np.testing.assert_array_equal(apart[[0, -1]], paths[[0, -1]])
    assert (apart[:, 0, 0] - apart[:, 1, 0])[15:30].min() > (paths[:, 0, 0] - paths[:, 1, 0])[15:30].min() + 0.05
