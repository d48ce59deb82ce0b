"""Arrivals of devices without a clock: batches are evened out, losses do no harm, time never runs back."""

import math
import random
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.arrival_clock import ArrivalClock
from devices.intake import DeviceIntake
from devices.sample import TrackerSample

USB_S = 0.016


def arrivals(rate_hz, seconds, *, batch=0.0, jitter=0.0, loss=0.0, stalls=0.0, offset=0.0, seed=0):
    """(true seconds, arrival seconds, number) of the readings that come, in order of arrival."""
    rng, last = random.Random(seed), 0.0
    for i in range(round(seconds * rate_hz)):
        true = i * (1 + offset) / rate_hz
        at = true + 0.002 + rng.random() * jitter + (rng.random() < stalls) * 0.1
        at = math.ceil(at / batch) * batch if batch else at
        if rng.random() >= loss:
            last = max(last + 1e-6, at)
            yield true, last, i


def errors_ms(numbered, *, from_s=15.0, **how):
    """Standard deviations of the time error of arrivals and of the clock, milliseconds."""
    clock, rows = ArrivalClock(), []
    for true, at, number in arrivals(**how):
        rows.append((true, at, clock.host_ns(round(at * 1e9), number % 256 if numbered else None) * 1e-9))
    true, at, mapped = np.array([row for row in rows if row[0] > from_s]).T
    assert (np.diff(mapped) > 0).all()
    return float(np.std(at - true)) * 1000, float(np.std(mapped - true)) * 1000


@pytest.mark.parametrize("rate_hz", [60.0, 100.0, 120.0, 250.0])
@pytest.mark.parametrize("numbered", [False, True])
def test_the_jitter_of_usb_batches_is_removed(rate_hz, numbered):
    before, after = errors_ms(numbered, rate_hz=rate_hz, seconds=60, batch=USB_S)
    assert before > 4.0
    assert after < 0.3 * before


def test_radio_jitter_is_removed():
    before, after = errors_ms(False, rate_hz=60.0, seconds=60, jitter=0.01)
    assert after < 0.3 * before


@pytest.mark.parametrize("loss", [0.01, 0.1, 0.3])
def test_numbers_tell_what_was_lost(loss):
    before, after = errors_ms(True, rate_hz=120.0, seconds=60, batch=USB_S, loss=loss)
    assert after < 0.3 * before


def test_numbers_tell_stalls_from_losses():
    before, after = errors_ms(True, rate_hz=100.0, seconds=60, batch=USB_S, loss=0.02, stalls=0.02)
    assert before > 10
    assert after < 1.0


@pytest.mark.parametrize(
    "how",
    [
        {"rate_hz": 120.0, "batch": USB_S, "loss": 0.01},
        {"rate_hz": 120.0, "batch": USB_S, "stalls": 0.02},
        {"rate_hz": 60.0, "jitter": 0.01, "loss": 0.05},
        {"rate_hz": 30.0, "jitter": 0.002, "loss": 0.05},
        {"rate_hz": 10.0, "jitter": 0.03, "loss": 0.02},
    ],
)
def test_without_numbers_losses_and_stalls_make_it_no_worse_than_arrival(how):
    before, after = errors_ms(False, seconds=60, **how)
    assert after <= 1.05 * before + 0.01


@pytest.mark.parametrize("offset", [-0.002, 0.002])
def test_a_rate_that_is_not_quite_the_nominal_is_found(offset):
    clock = ArrivalClock()
    for _, at, _ in arrivals(100.0, 30.0, batch=USB_S, offset=offset):
        clock.host_ns(round(at * 1e9))
    assert clock.period_s == pytest.approx((1 + offset) / 100, rel=1e-3)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32), st.floats(10, 300), st.floats(0, 0.03), st.floats(0, 0.4), st.floats(0, 0.05), st.booleans()
)
def test_later_readings_get_later_times_that_are_never_after_their_arrival_for_long(
    seed, rate_hz, jitter, loss, stalls, numbered
):
    clock, mapped, late = ArrivalClock(), [], []
    for _, at, number in arrivals(rate_hz, 8.0, jitter=jitter, loss=loss, stalls=stalls, seed=seed):
        mapped.append(clock.host_ns(round(at * 1e9), number % 65536 if numbered else None))
        late.append(mapped[-1] - round(at * 1e9))
    assert all(a < b for a, b in pairwise(mapped))
    assert max(late) < 1_000_000


@pytest.mark.parametrize("numbered", [False, True])
@pytest.mark.parametrize("rate_hz", [60.0, 240.0])
@pytest.mark.parametrize("held_s", [0.05, 0.2])
def test_what_piled_up_before_the_first_reading_does_not_quicken_the_beat(numbered, rate_hz, held_s):
    clock, rows = ArrivalClock(), []
    for true, at, number in arrivals(rate_hz, 4.0, jitter=0.002):
        at = max(at, held_s + 1e-6 * number)
        rows.append((true, clock.host_ns(round(at * 1e9), number if numbered else None) * 1e-9))
    true, mapped = np.array([row for row in rows if row[0] > 1.3]).T
    assert np.ptp(mapped - true) < 0.004
    assert np.diff(mapped).max() < 1 / rate_hz + 0.003


def test_after_a_pause_it_begins_anew():
    clock = ArrivalClock()
    for _, at, _ in arrivals(100.0, 5.0, batch=USB_S):
        clock.host_ns(round(at * 1e9))
    assert clock.host_ns(20_000_000_000) == 20_000_000_000
    assert clock.period_s == 0.0


def test_an_intake_evens_out_what_has_no_clock():
    intake, times = DeviceIntake({"1": "head"}), []
    for _, at, _ in arrivals(120.0, 20.0, batch=USB_S):
        times += [r.host_time_ns for r in intake.readings([TrackerSample("1", round(at * 1e9), (0.0, 1.0, 0.0))])]
    steps = np.diff(times[-600:]) * 1e-9
    np.testing.assert_allclose(steps, 1 / 120, atol=5e-4)
