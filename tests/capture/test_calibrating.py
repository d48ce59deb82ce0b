import numpy as np
import pytest

from capture import calibrating
from capture.calibrating import STEPS, CalibrationRun, CalibrationScript, CalibrationTake, StepKind
from capture.config import SessionConfig
from devices.errors import SettingError
from devices.frame import TrackerFrame
from reconstruction.database import open_database

T_POSE = {
    "root": (0.0, 0.95, 0.0),
    "head": (0.0, 1.6, 0.0),
    "left_wrist": (0.78, 1.4, 0.0),
    "right_wrist": (-0.78, 1.4, 0.0),
    "left_ankle": (0.1, 0.08, 0.0),
    "right_ankle": (-0.1, 0.08, 0.0),
}
HANGING = T_POSE | {"left_wrist": (0.3, 0.8, 0.0)}


def fed(script, seconds, pose, start, shake_m=0.0, fps=60):
    """Feeds a pose for a while, and gives the last prompt."""
    rng = np.random.default_rng(0)
    prompt = script.prompt
    for number in range(round(seconds * fps)):
        seen = {role: np.array(at) + shake_m * rng.normal(size=3) for role, at in pose.items()}
        prompt = script.feed(TrackerFrame.from_positions(start + number / fps, seen))
    return prompt


def test_the_steps_follow_each_other_and_the_t_pose_is_marked():
    script = CalibrationScript()
    assert script.prompt.kind is StepKind.READY
    assert script.prompt.seconds_left == STEPS[0].seconds
    assert fed(script, 1, HANGING, 100).seconds_left == pytest.approx(2, abs=0.05)
    assert fed(script, 2.1, T_POSE, 101).kind is StepKind.HOLD
    assert fed(script, 4, T_POSE, 103.1).kind is StepKind.MOVE
    moving = sum(step.seconds for step in STEPS if step.kind is StepKind.MOVE)
    prompt = fed(script, moving + 1, HANGING, 107.1, shake_m=0.05)
    assert prompt.done
    assert script.finished
    take = script.take()
    assert take.t_pose_s is not None
    first, last = take.t_pose_s
    assert 103 <= first < last < 108
    assert last - first == pytest.approx(3, abs=0.05)
    assert take.frames[0].time_s >= 103
    frames = len(take.frames)
    script.feed(TrackerFrame.from_positions(200, T_POSE))
    assert len(script.take().frames) == frames
    script.restart()
    assert not script.finished
    assert not script.take().frames


def test_the_countdown_waits_for_the_t_pose():
    script = CalibrationScript()
    fed(script, 3.1, T_POSE, 0)
    prompt = fed(script, 2, HANGING, 3.1)
    assert prompt.kind is StepKind.HOLD
    assert "left arm" in prompt.hint
    assert prompt.seconds_left == STEPS[1].seconds
    assert fed(script, 2, T_POSE, 5.1, shake_m=0.1).kind is StepKind.HOLD
    assert fed(script, 3.5, T_POSE, 7.1, shake_m=0.003).kind is StepKind.MOVE


def test_a_t_pose_that_never_comes_is_taken_as_it_is():
    script = CalibrationScript()
    fed(script, 3.1, T_POSE, 0)
    assert fed(script, CalibrationScript.PATIENCE_S + 0.1, HANGING, 3.1).kind is StepKind.MOVE


def test_calibrating_runs_beside_and_tells_what_went_wrong(database):
    run = CalibrationRun(CalibrationTake(()), open_database(database))
    with pytest.raises(SettingError, match="some seconds"):
        run.result()
    assert run.finished


def test_a_script_needs_steps():
    with pytest.raises(SettingError, match="one step"):
        CalibrationScript(())


def test_ctrl_c_ends_a_calibration_without_a_result(monkeypatch):
    monkeypatch.setattr(calibrating, "keep_quietly", lambda *_: None)
    with pytest.raises(KeyboardInterrupt):
        calibrating.calibrate_from_devices(SessionConfig(), 5.0, "library", None)
