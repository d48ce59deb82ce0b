from dataclasses import replace

import numpy as np
import pytest

from devices.errors import FileError, SettingError
from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.calibration import Profile, calibrate
from reconstruction.calibration_verdict import Grade
from reconstruction.kinematics import world_joints
from reconstruction.motion_operations import retargeted
from reconstruction.mounting import Mounting
from reconstruction.rotations import exponential, inverse, logarithm, multiply
from reconstruction.segments import SEGMENTS, scaled
from reconstruction.solver import reconstruct
from tests.reconstruction.conftest import strolling
from tests.reconstruction.test_effectors import frames_of, readings
from tests.reconstruction.test_solver import UNSEEN, errors_cm


def test_a_body_and_its_trackers_are_found(database):
    body = database.space.skeleton
    scales = {"stature": 0.93, "torso": 1.08, "upper arms": 0.92, "forearms": 0.92, "thighs": 1.06}
    rng = np.random.default_rng(0)
    worn = Mounting(rng.uniform(-0.04, 0.04, (6, 3)), exponential(rng.normal(0, 0.5, (6, 3))))
    performer = scaled(body, scales)
    result = calibrate(frames_of(*readings(retargeted(strolling(60, 240), performer), worn)), database)
    profile = result.profile
    assert result.grade is Grade.USABLE
    assert "T-pose" in result.verdict
    assert result.t_pose_s is None
    assert set(result.deviations_cm) == {*SEGMENTS, *ROLES}
    assert set(result.residuals_cm) == set(ROLES)

    def lengths(skeleton):
        return np.linalg.norm(skeleton.offsets, axis=1)[1:]

    found, plain = (np.mean(np.abs(lengths(s) / lengths(performer) - 1)) for s in (profile.skeleton(body), body))
    assert found < 0.6 * plain
    motion = retargeted(UNSEEN, performer)
    frames = frames_of(*readings(motion, worn))
    with_it = reconstruct(frames, database, profile.skeleton(body), mounting=profile.mounting).motion
    without = reconstruct(frames, database).motion
    assert errors_cm(motion, with_it)[15:].mean() < 0.5 * errors_cm(motion, without)[15:].mean()


def test_a_known_stature_is_kept(database):
    frames = frames_of(*readings(strolling(61, 60), Mounting.at_the_joints()))
    assert calibrate(frames, database, stature_m=1.75).profile.scales["stature"] == pytest.approx(1.0, abs=0.03)


def test_calibrating_works_at_any_rate_and_through_pauses(database):
    slow = strolling(63, 120)
    frames = frames_of(*readings(slow, Mounting.at_the_joints()))
    double = [replace(frame, time_s=frame.time_s + shift) for frame in frames for shift in (0.0, 1 / 120)]
    later = [replace(frame, time_s=frame.time_s + 100) for frame in frames]
    plain = calibrate(frames, database).profile
    for other in (double, frames[::2], [*frames, *later]):
        found = calibrate(other, database).profile
        assert found.scales["stature"] == pytest.approx(plain.scales["stature"], abs=0.03)


def test_swapped_trackers_are_named(database):
    where, turned = readings(strolling(64, 180), Mounting.at_the_joints())
    order = [0, 1, 3, 2, 4, 5]
    result = calibrate(frames_of(where[:, order], turned[:, order]), database)
    assert result.grade is Grade.POOR
    assert "left wrist and right wrist look swapped" in result.verdict


def test_mounted_turns_are_found(database):
    worn = Mounting(np.zeros((6, 3)), exponential(np.random.default_rng(5).normal(0, 0.5, (6, 3))))
    profile = calibrate(frames_of(*readings(strolling(65, 240), worn)), database).profile
    off = logarithm(multiply(inverse(profile.mounting.rotations), worn.rotations))
    assert np.degrees(np.linalg.norm(off, axis=1)).max() < 12


def test_a_subset_of_trackers_is_enough_to_run(database):
    frames = frames_of(*readings(strolling(62, 60), Mounting.at_the_joints()), ROLES[2:])
    profile = calibrate(frames, database).profile
    assert set(profile.scales) == {"stature", *SEGMENTS}
    assert np.isfinite(list(profile.scales.values())).all()


def test_too_little_to_see_is_refused(database):
    with pytest.raises(SettingError, match="some seconds"):
        calibrate([TrackerFrame.from_positions(0.0, {})], database)


def test_profiles_are_kept(tmp_path):
    profile = Profile({"stature": 1.1}, Mounting.at_the_joints(), 2.0, "usable", made="2026-11-22")
    profile.write(tmp_path / "me.json")
    back = Profile.read(tmp_path / "me.json")
    assert back.scales == profile.scales
    np.testing.assert_array_equal(back.mounting.rotations, profile.mounting.rotations)
    assert (back.verdict, back.made) == ("usable", "2026-11-22")
    assert np.isnan(back.height_m)
    assert [path.name for path in tmp_path.iterdir()] == ["me.json"]
    (tmp_path / "broken.json").write_text("{}")
    for name, words in (("broken.json", "not a performer's profile"), ("none.json", "No such file")):
        with pytest.raises(FileError, match=words):
            Profile.read(tmp_path / name)


def test_scaling_leaves_directions_alone(database):
    body = database.space.skeleton
    longer = scaled(body, {"stature": 1.2, "thighs": 1.1})
    ratio = np.linalg.norm(longer.offsets, axis=1) / np.linalg.norm(body.offsets, axis=1)
    knee = body.humanoid["left_lower_leg"]
    assert ratio[knee] == pytest.approx(1.32)
    assert ratio[body.humanoid["head"]] == pytest.approx(1.2)
    straight, _ = world_joints(body, np.zeros(3), np.tile([0, 0, 0, 1.0], (len(body), 1)))
    assert np.isfinite(straight).all()
