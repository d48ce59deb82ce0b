"""Device clocks on the host's: batches, drift, stalls and restarts."""

import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.clock_map import ClockMap

RATE_HZ = 100


def run(clock: ClockMap, seconds: float, *, drift: float = 0.0, start: float = 0.0, device_zero: float = 70.0, delay):
    """(true host seconds, mapped host seconds) of readings whose arrival is `delay(i)` later than true."""
    pairs = []
    for i in range(round(seconds * RATE_HZ)):
        true = start + i / RATE_HZ
        device = device_zero + (true - start) * (1 - drift)
        pairs.append((true, clock.host_ns(device, round((true + delay(i)) * 1e9)) * 1e-9))
    return pairs


def batches(rng: random.Random, least: float = 0.002, batch: float = 0.016):
    """Delays of an adapter that hands bytes over every 16 ms, with 2 % stragglers."""
    return lambda i: least + (-i / RATE_HZ) % batch + (rng.random() < 0.02) * rng.random() * 0.2


def test_without_jitter_nothing_is_changed():
    for true, mapped in run(ClockMap(), 60, delay=lambda i: 0.0):
        assert mapped == pytest.approx(true, abs=2e-9)


@pytest.mark.parametrize("drift", [0.0, 1e-4, -2e-4])
def test_the_jitter_of_batches_is_removed_and_drift_found(drift):
    clock = ClockMap()
    pairs = run(clock, 60, drift=drift, delay=batches(random.Random(1)))
    errors = [mapped - true - 0.002 for true, mapped in pairs if true > 10]
    assert max(map(abs, errors)) < 0.0015
    assert clock.drift == pytest.approx(drift, abs=1e-5)
    assert clock.restarts == 0


def test_intervals_are_even_where_arrivals_are_not():
    pairs = run(ClockMap(), 30, delay=batches(random.Random(2)))
    steps = [b[1] - a[1] for a, b in pairwise(pairs[500:])]
    assert max(abs(step - 1 / RATE_HZ) for step in steps) < 5e-4


def test_a_host_that_sleeps_leaves_the_map_as_it_was():
    clock = ClockMap()
    for true, mapped in run(clock, 20, delay=lambda i: 0.8 - (i - 1000) / RATE_HZ if 1000 <= i < 1080 else 0.001):
        assert mapped == pytest.approx(true + 0.001, abs=0.0015)
    assert clock.restarts == 0


def test_a_device_that_restarts_is_followed_without_time_running_back():
    clock = ClockMap()
    first = run(clock, 10, delay=lambda i: 0.001)
    second = run(clock, 10, start=12.0, device_zero=0.0, delay=lambda i: 0.001)
    assert clock.restarts == 1
    assert second[0][1] > first[-1][1]
    for true, mapped in second[80:]:
        assert mapped == pytest.approx(true + 0.001, abs=1e-3)


def test_a_clock_that_is_set_forward_is_followed():
    clock = ClockMap()
    run(clock, 10, delay=lambda i: 0.001)
    for true, mapped in run(clock, 5, start=10.0, device_zero=5000.0, delay=lambda i: 0.001):
        assert mapped == pytest.approx(true + 0.001, abs=1e-3)
    assert clock.restarts == 1


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.floats(-3e-4, 3e-4))
def test_later_readings_never_get_earlier_times(seed, drift):
    pairs = run(ClockMap(), 20, drift=drift, delay=batches(random.Random(seed)))
    mapped = [m for _, m in pairs]
    assert mapped == sorted(mapped)


def test_trackers_of_one_moment_stay_together():
    clock, rng = ClockMap(), random.Random(3)
    for i in range(3000):
        stamps = {clock.host_ns(i / 100, round((i / 100 + rng.random() * 0.01) * 1e9)) for _ in range(6)}
        assert max(stamps) - min(stamps) < 2_000_000 or i < 100
