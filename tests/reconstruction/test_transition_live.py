"""Live transitions: no seam at the start, none at the end, and the target is what is shown then."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.motion import Motion, Pose
from reconstruction.rotations import exponential, multiply
from reconstruction.standard_body import standard_skeleton
from reconstruction.transition import LiveTransition, clip_target, placed_under, prepared
from reconstruction.transition.clip import angular_accelerations
from reconstruction.transition.live import LIVE_BOUNDS

from .moving_bodies import standing, walking

DT = 1 / 60


def off(pose: Pose, rng: np.random.Generator, angle: float) -> Pose:
    """The same pose with every joint turned a little, and the root moved."""
    turned = multiply(pose.rotations, exponential(rng.normal(0, angle, (len(pose.rotations), 3))))
    return Pose(pose.time_s, pose.root_position + rng.normal(0, 0.05, 3), turned)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_it_starts_where_it_was_and_ends_on_the_target(seed: int) -> None:
    rng = np.random.default_rng(seed)
    target = standing(10).pose(3)
    shown = off(target, rng, 0.3)
    live = LiveTransition(shown, None, target)
    first = live.step(0.0)
    np.testing.assert_allclose(np.abs(np.sum(first.rotations * shown.rotations, axis=-1)), 1, atol=1e-12)
    np.testing.assert_allclose(first.root_position, shown.root_position, atol=1e-12)
    assert LIVE_BOUNDS.shortest_s <= live.duration_s <= LIVE_BOUNDS.longest_s
    while not live.done:
        last = live.step(DT)
    np.testing.assert_array_equal(last.rotations, target.rotations)


def test_farther_takes_longer() -> None:
    target = standing(10).pose(3)
    near, far = (off(target, np.random.default_rng(1), angle) for angle in (0.05, 0.5))
    assert LiveTransition(near, None, target).duration_s < LiveTransition(far, None, target).duration_s


def test_from_walking_into_a_clip_there_is_no_seam() -> None:
    motion, clip = walking(120), prepared(standing(240))
    poses = [motion.pose(k) for k in range(60)]
    target = clip_target(clip, 0, placed_under(clip.skeleton, poses[-1], clip, 0))
    live = LiveTransition(poses[-1], poses[-2], target)
    while not live.done:
        poses.append(live.step(DT))
    poses += [live.step(DT) for _ in range(20)]
    shown = np.stack([pose.rotations for pose in poses])
    seam = angular_accelerations(shown, 60)[57:]
    direct = np.concatenate([shown[:60], shown[-20:]])
    assert seam.max() < 0.1 * angular_accelerations(direct, 60).max()
    heights = np.array([pose.root_position[1] for pose in poses])
    assert np.abs(np.diff(heights)).max() < 0.02


def test_a_target_solved_live_is_followed() -> None:
    motion = walking(120)
    shown = off(motion.pose(0), np.random.default_rng(2), 0.2)
    live = LiveTransition(shown, None, motion.pose(0))
    errors = []
    for k in range(1, 60):
        pose = live.step(DT, motion.pose(k))
        errors.append(1 - np.abs(np.sum(pose.rotations * motion.rotations[k], axis=-1)).min())
    assert errors[0] > 1e-3
    assert errors[-1] < 1e-12
    assert np.all(np.diff(errors) < 1e-6)


def test_joints_that_are_on_target_stay_on_it() -> None:
    motion = walking(60)
    rotations = motion.rotations[0].copy()
    arm = motion.skeleton.names.index("LeftArm")
    rotations[arm] = multiply(rotations[arm], exponential(np.array([0.0, 0.8, 0.0])))
    live = LiveTransition(Pose(0.0, motion.root_positions[0], rotations), None, motion.pose(0))
    pose = live.step(DT, motion.pose(1))
    others = np.arange(len(rotations)) != arm
    np.testing.assert_allclose(pose.rotations[others], motion.rotations[1, others], atol=1e-12)
    assert np.linalg.norm(pose.rotations[arm] - motion.rotations[1, arm]) > 0.1


def test_a_single_frame_clip_is_held() -> None:
    motion = standing(5)
    clip = prepared(Motion(motion.skeleton, motion.root_positions[:1], motion.rotations[:1], motion.fps))
    shown = motion.pose(4)
    target = clip_target(clip, 0, placed_under(clip.skeleton, shown, clip, 0))
    assert target(5.0).root_position[1] == pytest.approx(motion.root_positions[0, 1])


@pytest.mark.parametrize("turn", [0.6, 2.5, 4.0])
def test_what_was_held_comes_to_a_moving_target_without_going_past_it(turn):
    skeleton = standard_skeleton(1.75)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), 1))

    def target(time_s: float) -> Pose:
        vector = np.zeros((len(skeleton), 3))
        vector[:, 1] = turn * np.sin(8 * time_s) + 0.5
        return Pose(time_s, np.array([time_s, 0.0, 0.0]), exponential(vector))

    live = LiveTransition(Pose(0.0, np.zeros(3), still), None, target, held=True)
    times = np.arange(1, 100) / 60
    poses = [live.step(1 / 60) for _ in times]
    shown = np.unwrap([2 * np.arctan2(*pose.rotations[3, [1, 3]]) for pose in poses])
    wanted = turn * np.sin(8 * times) + 0.5
    assert np.all(np.abs(shown) <= np.abs(wanted) + 1e-9) or turn > np.pi
    assert abs(shown[0]) < 0.01
    assert np.abs(np.diff(shown)).max() < 1
    assert poses[-1].root_position[0] == pytest.approx(times[-1])
