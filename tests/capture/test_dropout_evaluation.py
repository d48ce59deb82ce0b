"""Lost trackers, on a few clips of our own."""

import json

import numpy as np
import pytest

from capture.dropout_evaluation import DropoutScore, limb_of, table_of, without
from capture.evaluation_runs import tracker_frames
from devices.sample import ROLES
from tests.reconstruction.conftest import strolling


def test_only_the_lost_tracker_is_missing_and_only_in_the_gap():
    frames = tracker_frames(strolling(frames=30), ROLES)
    lost = without(frames, "left_wrist", slice(10, 20))
    measured = np.array([frame.measured for frame in lost])
    assert not measured[10:20, ROLES.index("left_wrist")].any()
    measured[10:20, ROLES.index("left_wrist")] = True
    assert measured.all()
    assert lost[9] is frames[9]
    assert np.isnan(lost[10].positions[ROLES.index("left_wrist")]).all()
    assert np.isfinite(frames[10].positions).all()


def test_a_limb_is_what_hangs_on_one_tracker():
    motion = strolling(frames=2)
    names = [motion.skeleton.names[joint] for joint in limb_of(motion, "left_wrist")]
    assert {"LeftArm", "LeftForeArm", "LeftHand"} <= set(names)
    assert all(name.startswith("Left") for name in names)
    assert limb_of(motion, "root").tolist() == [0]


def test_the_table_has_a_row_for_each_action_and_role():
    scores = [
        DropoutScore("a", "walk", "left_wrist", 2.0, 1.0, 0.1, 0.5),
        DropoutScore("b", "walk", "left_wrist", 4.0, 1.0, 0.3, 1.5),
        DropoutScore("a", "walk", "head", 1.0, 1.0, 0.0, 0.2),
    ]
    table = table_of(scores)
    assert "| walk | left wrist | 2 | 3.0 / 4.0 | 1.0 | 0.20 | 1.00 / 1.50 |" in table
    assert table.count("| walk |") == 2


def test_the_command_scores_each_clip_and_role(clips, tmp_path, run):
    out = tmp_path / "out"
    command = ("evaluate", "dropouts", "--data", clips, "--out", out, "--lost", "left_wrist,head", "--gap", 0.5)
    status, printed, told = run(*command, "--json")
    assert status == 0, told
    rows = json.loads(printed)
    assert {row["role"] for row in rows} == {"left_wrist", "head"}
    assert all(row["limb_cm"] >= 0 and row["whole_cm"] < 10 for row in rows)
    lost = [row for row in rows if row["role"] == "left_wrist"]
    assert np.mean([row["limb_cm"] for row in lost]) > np.mean([row["whole_cm"] for row in lost])


@pytest.mark.parametrize(
    ("options", "reason"),
    [(("--lost", "hand"), "tracker role 'hand'"), (("--gap", 9.5, "--seconds", 2), "longer than")],
)
def test_what_cannot_be_lost_is_told(clips, tmp_path, run, options, reason):
    status, _, told = run("evaluate", "dropouts", "--data", clips, "--out", tmp_path / "out", *options)
    assert status == 2
    assert reason in told
    assert "Traceback" not in told
