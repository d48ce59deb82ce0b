"""The session loop: what arrives is kept, placed, solved and handed on; it stops clean."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from capture.clock import SessionClock
from capture.session import Session, SessionDevice
from devices.assembler import FrameAssembler
from devices.errors import FileError
from devices.intake import IDENTITY_ASSIGNMENT, DeviceIntake
from tests.fakes import FakeDriver, readings_now


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


def session(driver, pipeline, recorder=None, watchers=()):
    clock = SessionClock()
    assembler = FrameAssembler(60.0, 0.01, epoch_ns=clock.start_ns)
    return Session(
        [SessionDevice(driver, DeviceIntake(IDENTITY_ASSIGNMENT))], assembler, pipeline, clock, recorder, watchers
    )


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
