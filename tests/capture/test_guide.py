"""The guide through calibration: what it says when, and what follows from a good and a poor result."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from capture import guide as guide_module
from capture.calibrating import CalibrationScript, CalibrationStep, StepKind
from capture.guide import CalibrationGuide
from capture.raster import placed_cards
from capture.scene import Scene
from capture.viewing import Controls
from devices.errors import SettingError
from devices.frame import TrackerFrame
from reconstruction.calibration import Grade
from tests.capture.test_calibrating import T_POSE

STEPS = (
    CalibrationStep("get into place", 1.0, StepKind.READY),
    CalibrationStep("hold the T-pose", 1.0, StepKind.HOLD),
    CalibrationStep("move", 1.0, StepKind.MOVE),
)


class Clock:
    """Stands until it is set on."""

    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


class Run:
    """A calibration that is through at once."""

    outcome: object = None
    fraction, finished = 0.5, True

    def __init__(self, take, database, height_m):
        assert take.frames
        assert take.t_pose_s is not None

    def result(self):
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome


def found(grade):
    return SimpleNamespace(
        grade=grade,
        verdict=f"a {grade.value} fit",
        advice=("bend your left elbow",),
        residuals_cm={"head": 0.4},
        profile=SimpleNamespace(height_m=1.68),
    )


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def guide(clock, monkeypatch):
    monkeypatch.setattr(guide_module, "CalibrationRun", Run)
    return CalibrationGuide(None, 1.7, CalibrationScript(STEPS), clock)


def performed(guide, start=0.0, until=None):
    """Shows the guide a T-pose and some movement, and gives what its banner said on the way."""
    said = [guide.banner()]
    for number in range(round((until or 3.6) * 60)):
        shift = 0.05 * np.sin(number) if number > 130 else 0.0
        pose = {role: np.array(at) + shift for role, at in T_POSE.items()}
        guide.watch(SimpleNamespace(frame=TrackerFrame.from_positions(start + number / 60, pose)))
        said.append(guide.banner())
    return said


def test_each_step_is_told_with_a_countdown(guide):
    Run.outcome = found(Grade.GOOD)
    said = performed(guide)
    texts = list(dict.fromkeys(banner.text for banner in said))
    assert texts == ["get into place", "hold the T-pose", "move", "Thank you. Finding your body ...", "That fits well"]
    assert said[0].count == "1"
    assert said[30].share == pytest.approx(0.5, abs=0.05)
    assert "step 1 of 3" in said[0].below


def test_nothing_begins_before_somebody_looks(guide):
    for number in range(600):
        guide.watch(SimpleNamespace(frame=TrackerFrame.from_positions(number / 60, T_POSE)))
    assert guide.banner().text == "get into place"


def test_a_good_result_is_taken_by_itself(guide, clock):
    Run.outcome = found(Grade.GOOD)
    banner = performed(guide)[-1]
    assert "a good fit" in banner.below
    assert "height 1.68 m; left over, cm: head 0.4" in banner.below
    assert not guide.finished
    clock.now_s = 30.0
    performed(guide, 10.0, 0.1)
    assert guide.finished
    assert guide.result is Run.outcome
    assert guide.banner() is None


def test_a_poor_result_is_tried_again_by_itself_with_its_advice(guide, clock):
    Run.outcome = found(Grade.POOR)
    banner = performed(guide)[-1]
    assert banner.text == "Once more, please"
    assert "bend your left elbow" in banner.below
    clock.now_s = 30.0
    assert performed(guide, 10.0, 0.1)[-1].text == "get into place"
    Run.outcome = found(Grade.GOOD)
    performed(guide, 20.0)
    assert guide.banner().text == "That fits well"


def test_a_calibration_that_fails_says_why_and_is_tried_again(guide, clock):
    Run.outcome = SettingError("the head was never seen")
    banner = performed(guide)[-1]
    assert "the head was never seen" in banner.below
    guide.accept()
    assert not guide.finished
    clock.now_s = 30.0
    assert performed(guide, 10.0, 0.1)[-1].text == "get into place"


def test_keys_take_a_poor_result_or_do_a_good_one_again(guide):
    controls = Controls(actions=guide.actions())
    Run.outcome = found(Grade.GOOD)
    performed(guide)
    controls.press("Backspace")
    assert guide.banner().text == "get into place"
    Run.outcome = found(Grade.POOR)
    performed(guide, 20.0)
    controls.press("Enter")
    assert guide.result is Run.outcome
    assert not controls.press("Enter")


def test_without_a_window_each_thing_is_said_once(guide):
    Run.outcome = found(Grade.GOOD)
    told = []
    for number in range(240):
        guide.watch(SimpleNamespace(frame=TrackerFrame.from_positions(number / 60, T_POSE)))
        guide.tell_changes(told.append)
    assert len(told) == len(set(told))
    assert told[0] == "get into place. get ready"
    assert "That fits well" in told[-1]


def test_the_banner_fits_the_picture_however_long_the_advice(guide):
    Run.outcome = found(Grade.POOR)
    Run.outcome.advice = ("bend and stretch both of your elbows much more than you did, please, " * 3,) * 3
    performed(guide)
    (placed,) = placed_cards(Scene(banner=guide.banner()), 1280, 720, (1.0, 1.0, 1.0))
    rows, columns = placed.card.shape[:2]
    assert placed.left + columns <= 1280
    assert placed.top + rows <= 720


def test_calibrating_really_works_behind_it(database):
    from capture.library import open_named_database

    guide = CalibrationGuide(open_named_database(str(database)), 1.75, CalibrationScript(STEPS))
    performed(guide)
    end = time.monotonic() + 60
    while "Finding" in guide.banner().text and time.monotonic() < end:
        performed(guide, 10.0, 0.05)
        time.sleep(0.02)
    assert guide.banner().text in ("That fits well", "That will do", "Once more, please")
    guide.accept()
    assert 1.4 < guide.result.profile.height_m < 2.1
