"""The library's motions are those of people: feet stay put, joints stay in range, flights are parabolas."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reconstruction.kinematics import world_joints
from reconstruction.motion_library import actions, demo_motion
from reconstruction.motion_library.actions import play
from reconstruction.motion_library.gait_tables import GRAVITY, walking_cadence
from reconstruction.motion_library.leap import Leap
from reconstruction.motion_library.library import _CLIPS, generate_library
from reconstruction.motion_library.script import FPS, Script

ACTIONS = tuple(_CLIPS)


@cache
def clip(action, seed=3, stature=1.75):
    rng = np.random.default_rng([seed])
    return play(getattr(actions, action)(rng), stature, rng, action)


@cache
def joints(action, seed=3):
    motion = clip(action, seed)
    return world_joints(motion.skeleton, motion.root_positions, motion.rotations)[0]


def place(action, joint):
    return joints(action)[:, clip(action).skeleton.names.index(joint)]


@pytest.mark.parametrize("action", ACTIONS)
def test_planted_feet_stay_where_they_are(action):
    for side in ("Left", "Right"):
        ball, ankle = place(action, f"{side}ToeBase"), place(action, f"{side}Foot")
        still = np.linalg.norm(np.diff(ankle, axis=0), axis=1) * FPS < 0.10
        down = ball[1:, 1] < 0.035
        slide = np.linalg.norm(np.diff(ball[:, [0, 2]], axis=0), axis=1)[still & down] * FPS
        assert len(slide) > 20
        assert slide.mean() < 0.01


@pytest.mark.parametrize("action", ACTIONS)
def test_no_foot_goes_through_the_floor(action):
    for side in ("Left", "Right"):
        for joint in ("Foot", "ToeBase", "ToeBase_end"):
            assert place(action, side + joint)[:, 1].min() > 0.0


@pytest.mark.parametrize("action", ACTIONS)
def test_knees_and_elbows_bend_one_way_only(action):
    motion = clip(action)
    for joint, sign in (("LeftLeg", 1), ("RightLeg", 1)):
        turn = Rotation.from_quat(motion.rotations[:, motion.skeleton.names.index(joint)]).as_rotvec()
        assert (sign * turn[:, 0]).min() > -0.03
        np.testing.assert_allclose(turn[:, 1:], 0, atol=1e-6)
        assert np.degrees(turn[:, 0].max()) < 150


@pytest.mark.parametrize("action", ACTIONS)
def test_no_joint_jumps(action):
    motion = clip(action)
    before, after = (Rotation.from_quat(q.reshape(-1, 4)) for q in (motion.rotations[:-1], motion.rotations[1:]))
    assert np.degrees((before.inv() * after).magnitude().max()) < 45
    assert np.linalg.norm(np.diff(motion.root_positions, 3, axis=0), axis=1).max() < 0.02


def test_walkers_step_at_the_published_rate():
    script = Script(8.0, forward=((0.0, 1.3), (8.0, 1.3)))
    rng = np.random.default_rng(1)
    motion = play(actions.Part(script), 1.70, rng, "steady walk")
    positions, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    heights = positions[:, motion.skeleton.names.index("LeftFoot"), 1]
    strides = np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] >= heights[2:]) & (heights[1:-1] > 0.12))
    rate = 2 * FPS / np.diff(strides).mean()
    assert rate == pytest.approx(float(walking_cadence(np.array(1.3), 1.70)), rel=0.08)
    speed = np.linalg.norm(motion.root_positions[-1] - motion.root_positions[0]) / motion.duration_s
    assert speed == pytest.approx(1.3, rel=0.03)


def test_a_jump_flies_a_parabola_to_its_height():
    jump = Leap(0.5, 0.3)
    script = Script(3.5, leaps=(jump,), steps=((0.0, 0.0),))
    motion = play(actions.Part(script), 1.75, np.random.default_rng(2), "jump")
    times = np.arange(len(motion)) / FPS
    flying = (times > jump.take_off + 0.02) & (times < jump.landing - 0.02)
    height = motion.root_positions[flying, 1]
    np.testing.assert_allclose(np.diff(height, 2) * FPS**2, -GRAVITY, rtol=1e-6)
    assert height.max() - motion.root_positions[0, 1] == pytest.approx(0.36, abs=0.015)


def test_runners_leave_the_floor_and_walkers_do_not():
    def lowest(action):
        return np.minimum(place(action, "LeftToeBase_end")[:, 1], place(action, "RightToeBase_end")[:, 1])

    assert lowest("run").max() > 0.03
    assert lowest("walk").max() < 0.03


def test_the_same_seed_gives_the_same_motions():
    first, second = (play(actions.walk(np.random.default_rng(9)), 1.7, np.random.default_rng(5), "a") for _ in range(2))
    np.testing.assert_array_equal(first.rotations, second.rotations)


def test_bodies_of_every_size_can_do_everything():
    for action in ACTIONS:
        for stature in (1.55, 1.95):
            motion = clip(action, 4, stature)
            assert np.isfinite(motion.rotations).all()
            assert motion.skeleton.offsets[0, 1] == pytest.approx(0.545 * stature)


@pytest.mark.slow
def test_the_library_has_its_size():
    motions = generate_library()
    assert 80_000 < sum(map(len, motions)) < 90_000
    assert len({motion.name for motion in motions}) == len(motions)


def test_the_demo_shows_everything_in_half_a_minute():
    motion = demo_motion()
    assert 25 < motion.duration_s < 35
    assert motion.root_positions[:, 1].max() - motion.root_positions[0, 1] > 0.2
