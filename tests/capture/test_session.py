"""The session loop: what arrives is kept, placed, solved and handed on; it stops clean."""

import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from capture.clock import SessionClock
from capture.device_settings import device_settings
from capture.session import Session, SessionDevice
from capture.tuning import LiveSetting, Tuning
from devices.assembler import FrameAssembler
from devices.errors import FileError
from devices.intake import IDENTITY_ASSIGNMENT, DeviceIntake
from devices.sample import ROLES
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice, read_take
from tests.fakes import FakeDriver, generic_readings, readings_now, wait_until

NUMBERED = dict(zip("123456", ROLES, strict=True))


class RecordingPipeline:
    """Remembers the frames it was given."""

    def __init__(self, seconds=0.0):
        self.frames, self.seconds = [], seconds

    def step(self, frame):
        time.sleep(self.seconds)
        self.frames.append(frame)
        return SimpleNamespace(frame=frame, stages_ns={"whole frame": 1000})

    def bow_out(self, last, frame_s):
        return [SimpleNamespace(frame="bow", stages_ns={})]


class ListRecorder:
    """Keeps what it is told, or fails."""

    def __init__(self, error=None):
        self.written, self.error, self.closed = [], error, 0

    def write(self, device, reading):
        if self.error:
            raise self.error
        self.written.append((device, reading))

    def keep_up(self, now_ns):
        pass

    def close(self):
        self.closed += 1


def session(driver, pipeline, recorder=None, watchers=(), tuning=None, tell=lambda _: None):
    clock = SessionClock()
    assembler = FrameAssembler(60.0, 0.01, epoch_ns=clock.start_ns)
    device = SessionDevice(driver, DeviceIntake(IDENTITY_ASSIGNMENT | NUMBERED))
    return Session([device], assembler, pipeline, clock, recorder, watchers, tuning, tell)


def run_for(running, seconds):
    stop = threading.Event()
    threading.Timer(seconds, stop.set).start()
    running.run(stop)


def changed_to(running, number, name, value):
    """Before that reading, when all before it are kept: asks for a setting, and goes on when it is so."""

    def change():
        wait_until(lambda: running.samples == 6 * number)
        running.tuning.ask(name, value)
        wait_until(lambda: running.tuning.settings[name].read() == value)

    return change


def recording_to(running, number, recorder):
    """Before that reading, when all before it are kept: asks for another take, and goes on when it is there."""

    def change():
        wait_until(lambda: running.samples == 6 * number)
        running.record(recorder)
        wait_until(lambda: running.recorder is recorder)

    return change


def test_frames_are_solved_in_order_and_handed_to_the_watchers():
    pipeline, seen = RecordingPipeline(), []
    running = session(FakeDriver(readings_now(60)), pipeline, watchers=[seen.append])
    run_for(running, 0.6)
    times = [frame.time_s for frame in pipeline.frames if frame.measured.all()]
    assert len(times) >= 15
    np.testing.assert_allclose(np.diff(times), 1 / 60, atol=1e-6)
    assert [shot.frame for shot in seen] == [*pipeline.frames, "bow"]
    assert running.latest is seen[-1]
    assert running.solved == len(seen) - 1


def test_everything_that_arrives_is_kept():
    readings = readings_now(40)
    recorder = ListRecorder()
    run_for(session(FakeDriver(list(readings)), None, recorder), 0.3)
    assert [reading for _, reading in recorder.written] == readings
    assert {device for device, _ in recorder.written} == {"fake"}


def test_settings_change_between_two_frames_and_the_take_solves_to_the_same_readings(tmp_path):
    """A session whose smoothing is switched on and off while it records, read back from its take."""
    path, placed, seen = tmp_path / "a.mcap", [], []
    with TakeRecorder(path) as recorder:
        device = RecordedDevice("fake", "generic", {}, NUMBERED)
        recorder.add_device(device)
        intake = device.intake()
        tuning = Tuning(device_settings("fake", intake))
        driver = FakeDriver(generic_readings(100))
        running = session(driver, RecordingPipeline(), recorder, [seen.append], tuning)
        steps = [("smooth", True), ("beta", 5.0), ("smooth", False)]
        for number, (key, value) in enumerate(steps, 1):
            driver.before[25 * number] = changed_to(running, 25 * number, f"device.fake.{key}", value)
        running.devices = (SessionDevice(driver, intake),)
        running.assembler.push = lambda readings: placed.extend(readings)
        run_for(running, 0.7)
    take = read_take(path)
    assert [change.values for change in take.changes] == [
        {"device.fake.smooth": True}, {"device.fake.beta": 5.0}, {"device.fake.smooth": False},
    ]  # fmt: skip
    counts = [change.chunks_before["fake"] for change in take.changes]
    assert counts == [25, 50, 75]
    assert len(placed) == 100 * 6
    assert take.readings() == sorted(placed, key=lambda reading: reading.host_time_ns)
    unchanged = replace(take, changes=())
    assert unchanged.readings() != take.readings()


def test_a_take_begins_and_ends_while_the_session_runs(tmp_path):
    first, second = TakeRecorder(tmp_path / "1.mcap"), TakeRecorder(tmp_path / "2.mcap")
    for recorder in (first, second):
        recorder.add_device(RecordedDevice("fake", "generic"))
    box = SimpleNamespace(value=0.5)
    tuning = Tuning([LiveSetting("x", "", lambda: box.value, lambda value: setattr(box, "value", value))])
    driver = FakeDriver(readings := generic_readings(90))
    running = session(driver, None, first, tuning=tuning)
    driver.before = {
        20: changed_to(running, 20, "x", 0.75),
        40: recording_to(running, 40, second),
        50: lambda: running.mark("here"),
        70: recording_to(running, 70, None),
    }
    run_for(running, 0.6)
    one, two = read_take(first.path), read_take(second.path)
    assert one.missing is two.missing is None
    assert [mark.text for mark in two.marks] == ["here"]
    assert [change.values for change in one.changes + two.changes] == [{"x": 0.75}] * 2
    chunks = tuple(reading.chunks[0] for reading in readings)
    assert (one.chunks["fake"], two.chunks["fake"]) == (chunks[:40], chunks[40:70])


def test_the_driver_is_closed_at_the_end():
    driver = FakeDriver(readings_now(3))
    run_for(session(driver, None), 0.05)
    assert driver.closed == 1


def test_a_recorder_that_fails_is_let_go_and_solving_goes_on():
    recorder, pipeline, told = ListRecorder(FileError("disk full")), RecordingPipeline(), []
    running = session(FakeDriver(readings_now(60)), pipeline, recorder, tell=told.append)
    run_for(running, 0.6)
    assert recorder.closed == 1
    assert running.recorder is None
    assert told == ["disk full; the session goes on without recording"]
    assert len([frame for frame in pipeline.frames if frame.measured.all()]) >= 15


def test_a_recorder_that_fails_ends_a_session_that_only_records():
    driver = FakeDriver(readings_now(3))
    with pytest.raises(FileError, match="disk"):
        run_for(session(driver, None, ListRecorder(FileError("disk full"))), 1.0)
    assert driver.closed == 1


def test_a_session_that_is_too_slow_skips_frames_and_stays_on_time():
    pipeline = RecordingPipeline(seconds=0.05)
    running = session(FakeDriver(readings_now(400, rate_hz=400)), pipeline)
    run_for(running, 1.0)
    assert running.skipped > 0
    times = [frame.time_s for frame in pipeline.frames]
    assert times == sorted(times)
    assert running.solved + running.skipped > 1.5 * running.solved
