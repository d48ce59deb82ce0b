"""The two clocks, told the time."""

import pytest

from capture.clock import PlaybackClock, SessionClock
from capture.latency import LatencyRecorder


def test_the_session_clock_counts_from_its_start():
    assert SessionClock(start_ns=5_000_000_000).seconds(7_500_000_000) == pytest.approx(2.5)


def test_playing_pausing_and_seeking():
    clock = PlaybackClock(10.0)
    assert clock.at(100.0) == 0.0
    assert clock.at(102.0) == pytest.approx(2.0)
    clock.toggle(102.0)
    assert clock.at(150.0) == pytest.approx(2.0)
    clock.toggle(150.0)
    assert clock.at(151.0) == pytest.approx(3.0)
    clock.seek(9.0, 151.0)
    assert clock.at(151.5) == pytest.approx(9.5)


def test_the_end_loops_or_holds():
    assert PlaybackClock(10.0).at(0.0) == 0.0
    looped, held = PlaybackClock(10.0), PlaybackClock(10.0, loop=False)
    for clock in (looped, held):
        clock.at(0.0)
    assert looped.at(12.0) == pytest.approx(2.0)
    assert held.at(12.0) == 10.0


def test_speed_changes_from_where_it_stands():
    clock = PlaybackClock(10.0)
    clock.at(0.0)
    clock.set_speed(0.5, 2.0)
    assert clock.at(4.0) == pytest.approx(3.0)


def test_a_step_pauses():
    clock = PlaybackClock(10.0)
    clock.at(0.0)
    clock.step(-0.5, 2.0)
    assert not clock.playing
    assert clock.at(9.0) == pytest.approx(1.5)


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
