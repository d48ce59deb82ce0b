"""The grid of made-up bodies, on a few clips of our own."""

import json
import shutil

import numpy as np
import pytest

from capture.calibration_evaluation import GRID, GridBody, held_t_pose, tracker_readings
from devices.sample import ROLES
from reconstruction.kinematics import world_joints
from reconstruction.mounting import Mounting
from reconstruction.standard_body import standard_skeleton
from reconstruction.t_pose import found_t_pose


def test_the_grid_spans_what_people_are():
    assert min(b.stature_m for b in GRID) == 1.5
    assert max(b.stature_m for b in GRID) == 1.95
    assert {b.rate_hz for b in GRID} == {60, 120, 240}
    assert max(b.offset_cm for b in GRID) == 8
    assert max(b.noise_mm for b in GRID) == 5


def test_a_held_t_pose_is_taken_for_one():
    rng = np.random.default_rng(3)
    motion = held_t_pose(standard_skeleton(1.7), 120, rng)
    body = GridBody(1.7, 0, 0, 2, 120, turn_noise_deg=2)
    frames = tracker_readings(motion, Mounting.at_the_joints(), body, rng)
    held = found_t_pose(frames)
    assert held is not None
    assert held[1] - held[0] > 2
    assert np.isfinite(frames[0].orientations).all()
    joints, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    ankles = joints[:, [motion.skeleton.role_joint(role) for role in ROLES[4:]], 1]
    assert ankles.min() == pytest.approx(0.039 * 1.7, abs=0.01)


def test_the_command_prints_a_row_a_body(clips, tmp_path, run):
    status, _, told = run("evaluate", "calibration", "--data", clips, "--out", tmp_path / "few")
    assert status == 2
    assert "calibration needs two" in told
    data = tmp_path / "data"
    shutil.copytree(clips, data)
    shutil.copy(data / "run_1.bvh", data / "run_2.bvh")
    status, printed, told = run(
        "evaluate", "calibration", "--data", data, "--out", tmp_path / "enough", "--bodies", 1, "--json"
    )
    assert status == 0, told
    (row,) = json.loads(printed)
    assert row["ratio"] == pytest.approx(row["calibrated_cm"] / row["ideal_cm"], rel=0.05)
    assert row["calibrated_cm"] < 20
