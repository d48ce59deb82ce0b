import numpy as np
import pytest

from devices.frame import TrackerFrame
from reconstruction.kinematics import world_joints
from reconstruction.t_pose import Stillness, found_t_pose, hint, mean_orientations, t_pose

AT = {
    "root": (0.0, 0.95, 0.0),
    "head": (0.0, 1.6, 0.0),
    "left_wrist": (0.75, 1.4, 0.0),
    "right_wrist": (-0.75, 1.4, 0.0),
    "left_ankle": (0.1, 0.08, 0.0),
    "right_ankle": (-0.1, 0.08, 0.0),
}
DOWN = AT | {"left_wrist": (0.25, 0.85, 0.0), "right_wrist": (-0.25, 0.85, 0.0)}


def frames(parts, fps=60.0, noise_m=0.0):
    """parts: (pose, seconds, metres a second that it drifts)."""
    rng, out, time = np.random.default_rng(0), [], 0.0
    for pose, seconds, drift in parts:
        for number in range(round(seconds * fps)):
            way = np.array([drift * number / fps, 0.0, 0.0])
            seen = {role: np.array(at) + way + noise_m * rng.normal(size=3) for role, at in pose.items()}
            out.append(TrackerFrame.from_positions(time, seen))
            time += 1 / fps
    return out


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
def test_the_t_pose_is_found_among_other_things(fps):
    found = found_t_pose(frames([(DOWN, 2, 0), (AT, 3, 0), (DOWN, 2, 0.5)], fps, noise_m=0.005))
    assert found is not None
    assert found == pytest.approx((2, 5), abs=0.4)


def test_arms_down_or_moving_is_no_t_pose():
    assert found_t_pose(frames([(DOWN, 3, 0), (AT, 3, 0.4)])) is None


def test_a_pause_in_the_frames_ends_a_still_stretch():
    still = Stillness()
    for frame in frames([(AT, 1, 0)]):
        still.add(frame)
    assert still.since_s == 0.0
    still.add(TrackerFrame.from_positions(9.0, AT))
    assert still.since_s == np.inf


@pytest.mark.parametrize(
    ("role", "place", "words"),
    [("left_wrist", (0.5, 0.9, 0), "raise your left"), ("right_wrist", (-0.7, 2.0, 0), "lower your right"),
     ("left_wrist", (0.1, 1.4, 0), "stretch both")],
)  # fmt: skip
def test_the_hint_names_what_is_missing(role, place, words):
    seen = TrackerFrame.from_positions(0, AT | {role: place}).positions
    assert hint(seen).startswith(words)
    assert not hint(TrackerFrame.from_positions(0, AT).positions)


def test_the_pose_has_straight_limbs(database):
    pose, space = t_pose(database), database.space
    joints, _ = world_joints(space.skeleton, pose.q[:3], space.rotations(pose.q[None], np.zeros(3))[0])
    bones = space.skeleton.humanoid
    for side, sign in (("left", 1), ("right", -1)):
        arm = joints[bones[f"{side}_hand"]] - joints[bones[f"{side}_upper_arm"]]
        leg = joints[bones[f"{side}_foot"]] - joints[bones[f"{side}_upper_leg"]]
        assert sign * arm[0] / np.linalg.norm(arm) > 0.999
        assert -leg[1] / np.linalg.norm(leg) > 0.99
    np.testing.assert_allclose(joints[[space.skeleton.role_joint("head")]], pose.trackers[1:2], atol=1e-9)


def test_mean_orientations_take_either_sign():
    turn = np.array([0.0, 0.6, 0.0, 0.8])
    seen = [TrackerFrame.from_positions(0, {"head": np.ones(3)}, {"head": s * turn}) for s in (1, -1, 1)]
    mean = mean_orientations(seen)
    np.testing.assert_allclose(mean[1], turn, atol=1e-12)
    assert np.isnan(mean[0]).all()
