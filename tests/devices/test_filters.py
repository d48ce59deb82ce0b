"""The filter smooths what rests and hardly delays what moves; the gate keeps out what cannot be."""

import math
import random
from dataclasses import replace

import pytest

from devices.errors import SettingError
from devices.filters import GateSettings, OneEuroFilter, OneEuroSettings, OutlierGate, measured_lag_s
from devices.intake import DeviceIntake
from devices.sample import SampleFlag, TrackerSample

SETTINGS = OneEuroSettings()


def test_at_rest_noise_shrinks():
    rng, smooth = random.Random(0), OneEuroFilter(OneEuroSettings(min_cutoff_hz=1.0, beta=1.0))
    noisy = [rng.gauss(0, 0.002) for _ in range(1200)]
    calm = [smooth(i / 60, (x, 0.0, 0.0), None)[0][0] for i, x in enumerate(noisy)][120:]
    assert sum(x * x for x in calm) < 0.1 * sum(x * x for x in noisy[120:])


def test_a_cut_off_without_beta_is_a_plain_low_pass():
    """At its cut-off frequency a first-order low-pass lets 1 / sqrt(2) through."""
    smooth = OneEuroFilter(OneEuroSettings(min_cutoff_hz=2.0, beta=0.0))
    out = [smooth(i / 1000, (math.sin(2 * math.pi * 2.0 * i / 1000), 0, 0), None)[0][0] for i in range(8000)]
    assert max(out[4000:]) == pytest.approx(1 / math.sqrt(2), rel=0.01)


def test_lag_is_measured_and_falls_with_speed():
    slow, fast = measured_lag_s(SETTINGS, 0.1, 60), measured_lag_s(SETTINGS, 3.0, 60)
    assert 0.0 < fast < 0.002 < slow < 0.02
    # On a ramp a first-order low-pass of time constant tau is tau behind.
    assert measured_lag_s(OneEuroSettings(4.0, 0.0), 1.0, 1000) == pytest.approx(1 / (2 * math.pi * 4.0), rel=0.02)


def test_settings_take_effect_at_once_and_are_checked():
    smooth = OneEuroFilter(OneEuroSettings(0.5, 0.0))
    smooth(0.0, (0.0, 0, 0), None)
    held = smooth(0.01, (1.0, 0, 0), None)[0][0]
    smooth.settings = OneEuroSettings(1000.0, 0.0)
    assert held < 0.1 < 0.9 < smooth(0.02, (1.0, 0, 0), None)[0][0]
    with pytest.raises(SettingError):
        OneEuroSettings(min_cutoff_hz=0)
    with pytest.raises(SettingError):
        GateSettings(min_quality=2)


def test_turns_are_smoothed_along_the_shorter_way():
    smooth = OneEuroFilter(SETTINGS)
    smooth(0.0, (0, 0, 0), (0.0, 0.0, 0.0, 1.0))
    _, q = smooth(1 / 60, (0, 0, 0), (0.0, -math.sin(0.05), 0.0, -math.cos(0.05)))
    angle = 2 * math.atan2(abs(q[1]), abs(q[3]))
    assert 0 < angle < 0.1
    assert math.dist(q, (0, 0, 0, 0)) == pytest.approx(1)


def sample(x: float, **change) -> TrackerSample:
    return replace(TrackerSample("1", 0, (x, 1.0, 0.0)), **change)


def test_jumps_are_kept_out_until_they_prove_right():
    gate = OutlierGate(GateSettings(accept_after=3))
    assert gate(0.00, sample(0.0))
    assert not gate(0.01, sample(2.0))
    assert gate(0.02, sample(0.1))
    assert [gate(0.03 + i / 100, sample(5.0)) for i in range(5)] == [False, False, True, True, True]
    assert gate.rejected == 3


def test_suspect_and_poor_readings_are_kept_out():
    gate = OutlierGate(GateSettings(min_quality=0.3))
    assert not gate(0.0, sample(0.0, flags=SampleFlag.SUSPECT))
    assert not gate(0.0, sample(0.0, quality=0.2))
    assert gate(0.0, sample(0.0, quality=0.4))
    assert gate(0.1, sample(0.0))


def test_an_intake_filters_each_tracker_by_itself():
    intake = DeviceIntake({"1": "head", "2": "root"}, smoothing=SETTINGS)
    outliers = 0
    for i in range(200):
        wild = i % 50 == 49
        outliers += wild
        at = dict(host_time_ns=i * 10_000_000, device_time_s=i / 100)
        found = intake.readings([sample(9.0 if wild else 0.0, **at), sample(1.0, tracker="2", **at)])
        assert [r.position[0] for r in found] == pytest.approx([1.0] if wild else [0.0, 1.0])
    assert intake.rejected == outliers
