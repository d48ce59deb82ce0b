"""What befalls a session, and what is left of its take: real processes, ports and disks, each with its stated outcome.

docs/robustness.md states the outcomes.
"""

import ast
import resource
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from capture import going_live
from capture.config import DeviceConfig, SessionConfig
from capture.going_live import keep_quietly
from capture.session import Session
from devices.errors import SixpointError
from devices.sample import ROLES
from devices.simulators.pty_simulator import simulate_device
from replay_logs.golden_takes import walking_on_the_spot
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice, Take, read_take
from tests.capture.test_session import RecordingPipeline, run_for, session
from tests.fakes import FakeDriver, generic_readings, wait_until

ROOT = Path(__file__).parents[2]
LEAST_KEPT_NS = 250_000_000


@contextmanager
def recording(take: Path):
    """`sixpoint record` in a process of its own, of a simulated device in this one; begun, and a second old."""
    with simulate_device(walking_on_the_spot(ROLES, 5.0), "generic", roles=ROLES, loop=True, quiet=True) as device:
        command = "from capture.cli import script; script()"
        arguments = ["record", "--port", device.path, "--out", str(take)]
        process = subprocess.Popen(
            [sys.executable, "-c", command, *arguments], cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL
        )
        try:
            wait_until(lambda: take.exists() and take.stat().st_size > 2000, seconds=60)
            time.sleep(1.0)
            yield process, device
        finally:
            process.kill()
            process.communicate()


def assert_unbroken(take: Take) -> None:
    """Every sample of every tracker is there from the first on."""
    by_tracker = {}
    for sample in take.samples(take.devices[0]):
        by_tracker.setdefault(sample.tracker, []).append(sample.sequence)
    assert len(by_tracker) == len(ROLES)
    for numbers in by_tracker.values():
        assert all((b - a) % 65536 == 1 for a, b in pairwise(numbers))


def test_killed_outright_a_take_lacks_at_most_a_quarter_of_a_second(tmp_path):
    path = tmp_path / "a.mcap"
    with recording(path) as (process, _):
        killed_ns = time.perf_counter_ns()
        process.kill()
        process.wait()
    take = read_take(path)
    assert "cut off" in take.missing
    last_ns = max(chunk.host_time_ns for chunk in take.chunks["trackers"])
    assert killed_ns - last_ns < LEAST_KEPT_NS
    assert_unbroken(take)


def test_a_device_that_is_gone_when_the_process_is_killed_has_lost_nothing(tmp_path):
    """What came last reaches the disk though nothing comes after it."""
    path = tmp_path / "a.mcap"
    with recording(path) as (process, device):
        device.stall()
        time.sleep(0.6)
        process.kill()
        process.wait()
        sent = device.samples_sent
    take = read_take(path)
    assert len(list(take.samples(take.devices[0]))) == sent
    assert_unbroken(take)


slow = pytest.mark.slow


@pytest.mark.parametrize(
    "kind", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=slow), pytest.param(signal.SIGINT, marks=slow)]
)
def test_a_session_that_is_told_to_end_finishes_its_take(tmp_path, kind):
    path = tmp_path / "a.mcap"
    with recording(path) as (process, _):
        process.send_signal(kind)
        assert process.wait(20) == 0
    take = read_take(path)
    assert take.missing is None
    assert_unbroken(take)


@contextmanager
def small_disk(size: int):
    """No file of this process grows beyond that."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_ends_the_take_and_not_the_session(tmp_path):
    recorder = TakeRecorder(tmp_path / "a.mcap")
    recorder.add_device(RecordedDevice("fake", "generic"))
    pipeline, told, readings = RecordingPipeline(), [], generic_readings(400, rate_hz=400.0)
    running = session(FakeDriver(list(readings)), pipeline, recorder, tell=told.append)
    with small_disk(20_000):
        run_for(running, 1.2)
    assert len(told) == 1
    assert "recording stopped" in told[0]
    assert "the session goes on without recording" in told[0]
    assert pipeline.frames[-1].time_s > 0.9
    kept = read_take(recorder.path)
    chunks = kept.chunks["fake"]
    assert kept.missing
    assert chunks == tuple(reading.chunks[0] for reading in readings[: len(chunks)])
    assert 10 < len(chunks) < 400


def test_a_lost_window_ends_neither_the_session_nor_its_take(tmp_path, monkeypatch, capsys):
    def dies(*_):
        time.sleep(0.2)
        raise SixpointError("the window is lost: its process ended with status -9")

    monkeypatch.setattr("capture.live_window.show_session", dies)
    recorder = TakeRecorder(tmp_path / "a.mcap")
    recorder.add_device(RecordedDevice("fake", "generic"))
    pipeline = RecordingPipeline()
    running = session(FakeDriver(readings := generic_readings(100)), pipeline, recorder)
    going_live.run_session(running, seconds=1.0, shown=True)
    assert "the window is lost: its process ended with status -9; the session goes on" in capsys.readouterr().err
    assert pipeline.frames[-1].time_s > 0.8
    take = read_take(recorder.path)
    assert take.missing is None
    assert len(take.chunks["fake"]) == len(readings)


def test_a_window_that_is_closed_ends_the_session_in_order(tmp_path, monkeypatch):
    monkeypatch.setattr("capture.live_window.show_session", lambda *_: time.sleep(0.5))
    recorder = TakeRecorder(tmp_path / "a.mcap")
    recorder.add_device(RecordedDevice("fake", "generic"))
    driver = FakeDriver(readings := generic_readings(50))
    going_live.run_session(session(driver, RecordingPipeline(), recorder), seconds=None, shown=True)
    take = read_take(recorder.path)
    assert take.missing is None
    assert len(take.chunks["fake"]) == len(readings)
    assert driver.closed == 1


def test_a_clock_that_is_set_changes_nothing(tmp_path, monkeypatch):
    """The date leaps by an hour, forwards and back, while a session runs."""
    leap, real = [0.0], time.time
    monkeypatch.setattr(time, "time", lambda: real() + leap[0])
    monkeypatch.setattr(time, "time_ns", lambda: round((real() + leap[0]) * 1e9))
    recorder = TakeRecorder(tmp_path / "a.mcap")
    recorder.add_device(RecordedDevice("fake", "generic"))
    driver = FakeDriver(generic_readings(100))
    driver.before = {30: lambda: leap.__setitem__(0, 3600.0), 60: lambda: leap.__setitem__(0, -3600.0)}
    pipeline = RecordingPipeline()
    running: Session = session(driver, pipeline, recorder)
    run_for(running, 0.8)
    assert leap == [-3600.0]
    steps = [b.time_s - a.time_s for a, b in pairwise(pipeline.frames)]
    assert steps == pytest.approx([1 / 60] * len(steps))
    assert len(steps) > 25
    assert read_take(recorder.path).duration_s == pytest.approx(99 / 200, abs=1e-6)


_WALL_CLOCK = {
    ("time", "time"),
    ("time", "time_ns"),
    ("datetime", "now"),
    ("datetime", "utcnow"),
    ("datetime", "today"),
}
_NAMES_THINGS_BY_DATE = {"recorder.py", "going_live.py", "take_desk.py"}


def test_nothing_in_a_session_goes_by_the_date():
    """Only what names a take or says when it was made asks for the date: a test of all sources of time."""
    asked = set()
    for folder in ("devices", "replay_logs", "capture"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                named = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
                if named and (node.value.id, node.attr) in _WALL_CLOCK:
                    asked.add(path.name)
    assert asked <= _NAMES_THINGS_BY_DATE


def test_a_cable_pulled_during_start_up_is_one_line_and_no_take(tmp_path):
    take = tmp_path / "a.mcap"
    with simulate_device(walking_on_the_spot(ROLES[:4], 5.0), "fastrak", roles=ROLES[:4], quiet=True) as device:
        config = SessionConfig(device=(DeviceConfig(protocol="fastrak", port=device.path),))
        threading.Timer(0.15, device.unplug).start()
        with pytest.raises(SixpointError) as caught:
            keep_quietly(config, take, 1.0)
    assert device.path in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not take.exists()
