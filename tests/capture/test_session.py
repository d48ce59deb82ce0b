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
from tests.fakes import FakeDriver, generic_readings, readings_now


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
        self.written, self.error = [], error

    def write(self, device, reading):
        if self.error:
            raise self.error
        self.written.append((device, reading))


def session(driver, pipeline, recorder=None, watchers=(), tuning=None):
    clock = SessionClock()
    assembler = FrameAssembler(60.0, 0.01, epoch_ns=clock.start_ns)
    device = SessionDevice(driver, DeviceIntake(IDENTITY_ASSIGNMENT))
    return Session([device], assembler, pipeline, clock, recorder, watchers, tuning)


def run_for(running, seconds):
    stop = threading.Event()
    threading.Timer(seconds, stop.set).start()
    running.run(stop)


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
        device = RecordedDevice("fake", "generic", {}, dict(zip("123456", ROLES, strict=True)))
        recorder.add_device(device)
        intake = device.intake()
        tuning = Tuning(device_settings("fake", intake))
        running = session(
            FakeDriver(generic_readings(90), paced=True), RecordingPipeline(), recorder, [seen.append], tuning
        )
        running.devices = (SessionDevice(running.devices[0].driver, intake),)
        running.assembler.push = lambda readings: placed.extend(readings)
        for delay, name, value in [(0.1, "smooth", True), (0.2, "beta", 5.0), (0.3, "smooth", False)]:
            threading.Timer(delay, tuning.ask, [f"device.fake.{name}", value]).start()
        run_for(running, 0.7)
    take = read_take(path)
    assert [change.values for change in take.changes] == [
        {"device.fake.smooth": True}, {"device.fake.beta": 5.0}, {"device.fake.smooth": False},
    ]  # fmt: skip
    counts = [change.chunks_before["fake"] for change in take.changes]
    assert 0 < counts[0] < counts[1] < counts[2] < 90
    assert len(placed) == 90 * 6
    assert take.readings() == sorted(placed, key=lambda reading: reading.host_time_ns)
    unchanged = replace(take, changes=())
    assert unchanged.readings() != take.readings()


def test_a_take_begins_and_ends_while_the_session_runs(tmp_path):
    first, second = TakeRecorder(tmp_path / "1.mcap"), TakeRecorder(tmp_path / "2.mcap")
    for recorder in (first, second):
        recorder.add_device(RecordedDevice("fake", "generic"))
    box = SimpleNamespace(value=0.5)
    tuning = Tuning([LiveSetting("x", "", lambda: box.value, lambda value: setattr(box, "value", value))])
    running = session(FakeDriver(generic_readings(90), paced=True), None, first, tuning=tuning)
    threading.Timer(0.1, tuning.ask, ["x", 0.75]).start()
    threading.Timer(0.2, running.record, [second]).start()
    threading.Timer(0.3, running.mark, ["here"]).start()
    threading.Timer(0.4, running.record, [None]).start()
    run_for(running, 0.6)
    one, two = read_take(first.path), read_take(second.path)
    assert one.missing is two.missing is None
    assert [mark.text for mark in two.marks] == ["here"]
    assert [change.values for change in one.changes + two.changes] == [{"x": 0.75}] * 2
    kept = one.chunks["fake"] + two.chunks["fake"]
    assert 0 < len(one.chunks["fake"]) < len(kept) < 90
    assert [chunk.data for chunk in kept] == [r.chunks[0].data for r in generic_readings(90)][: len(kept)]


def test_the_driver_is_closed_at_the_end():
    driver = FakeDriver(readings_now(3))
    run_for(session(driver, None), 0.05)
    assert driver.closed == 1


def test_a_recorder_that_fails_ends_the_session_with_its_error():
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
