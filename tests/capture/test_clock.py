"""The session's clock, told the time, and the latency figures."""

import pytest

from capture.clock import SessionClock
from capture.latency import LatencyRecorder


def test_the_session_clock_counts_from_its_start():
    assert SessionClock(start_ns=5_000_000_000).seconds(7_500_000_000) == pytest.approx(2.5)


def test_percentiles_are_in_milliseconds():
    recorder = LatencyRecorder()
    for value in range(1, 101):
        recorder.add("solve", value * 1_000_000)
    row = recorder.summary()["solve"]
    assert row["p50"] == pytest.approx(50.5)
    assert row["max"] == pytest.approx(100)


def test_only_the_newest_durations_count():
    recorder = LatencyRecorder(capacity=2)
    for value in (9, 1, 3):
        recorder.add("solve", value * 1_000_000)
    assert recorder.summary()["solve"]["max"] == pytest.approx(3)
