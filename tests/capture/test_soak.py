"""Long sessions: what is measured, and that memory stays flat."""

import time

import numpy as np
import pytest

from capture.live_benchmark import bench_config
from capture.soak import PARTS, SoakMeter, figures, memory_mb, soak, table
from capture.start_up import process_age_s


def test_figures_are_told_by_tenths():
    meter = SoakMeter(seconds=100.0)
    for number in range(1, 1001):
        meter.add(number / 10, 1.0 + (number > 900))
    assert len(meter.parts) == PARTS
    assert [part.poses for part in meter.parts] == [100] * PARTS
    assert [part.p50_ms for part in meter.parts] == [1.0] * 9 + [2.0]
    assert figures(meter.parts)["p50_ratio"] == 2.0
    assert memory_mb() > 10
    assert table(meter.parts).row_count == PARTS


def test_a_process_grows_older():
    now_ns = time.perf_counter_ns()
    assert 0 < process_age_s(now_ns) < 36_000
    assert process_age_s(now_ns + 10**9) - process_age_s(now_ns) == pytest.approx(1.0)


def run(seconds):
    parts = soak(bench_config("library", "low", 60.0), seconds)
    assert sum(part.poses for part in parts) == pytest.approx(60 * seconds, abs=3)
    return parts


def test_a_session_on_its_own_clock_skips_nothing():
    run(10.0)


@pytest.mark.nightly
def test_memory_and_latency_stay_flat_for_an_hour():
    parts = run(3600.0)
    told = figures(parts)
    # The take keeps an index of its chunks for its end, about 230 bytes for every 150 ms: five megabytes.
    assert told["memory_grown_mb"] < 15
    medians = np.array([part.p50_ms for part in parts[1:]])
    assert medians.max() < 1.5 * medians.min()
