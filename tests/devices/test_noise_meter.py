"""Noise at rest is measured, movement is not taken for it, and smoothing goes by it."""

import math
import random

import pytest

from devices.filters import OneEuroSettings
from devices.intake import DeviceIntake
from devices.noise_meter import NoiseMeter, trembling
from devices.sample import TrackerSample


def measured(sigma, seconds=20.0, rate_hz=60.0, moving=lambda t: 0.0, seed=0):
    meter, rng = NoiseMeter(), random.Random(seed)
    for tick in range(round(seconds * rate_hz)):
        t = tick / rate_hz
        meter.add(t, (moving(t) + rng.gauss(0, sigma), rng.gauss(0, sigma), 1.0 + rng.gauss(0, sigma)))
    return meter.sigma_m


@pytest.mark.parametrize("sigma", [0.0005, 0.002, 0.005])
@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 120.0, 240.0])
def test_noise_at_rest_is_measured(sigma, rate_hz):
    assert measured(sigma, rate_hz=rate_hz) == pytest.approx(sigma, rel=0.2)


def test_breathing_and_sway_are_not_noise():
    assert measured(0.0, moving=lambda t: 0.01 * math.sin(2 * math.pi * 0.3 * t)) < 1e-5


def test_nothing_is_known_of_what_never_rests():
    assert measured(0.002, moving=lambda t: 0.5 * math.sin(2 * math.pi * t)) is None


def test_rests_between_movements_count():
    moving = lambda t: 0.3 * math.sin(2 * math.pi * t) if t % 4 < 2 else 0.0  # noqa: E731
    assert measured(0.001, moving=moving) == pytest.approx(0.001, rel=0.25)


def test_a_pause_is_no_rest():
    meter = NoiseMeter()
    for tick in range(200):
        meter.add(0.3 * tick, (0.0, 0.0, 0.0))
    assert meter.sigma_m is None


def test_the_trackers_that_tremble_are_named():
    rng = random.Random(5)
    samples = [
        TrackerSample(name, round(tick / 60 * 1e9), tuple(rng.gauss(0, sigma) for _ in range(3)))
        for tick in range(300)
        for name, sigma in (("b", 0.004), ("a", 0.003), ("calm", 0.0005))
    ]
    assert trembling(samples, 2.0) == ["a", "b"]
    assert trembling(samples, 10.0) == []


def smoothed(sigma, settings):
    """Whether an intake has smoothed the last of ten seconds' readings of a resting tracker."""
    intake, rng = DeviceIntake({"1": "head"}, smoothing=settings), random.Random(3)
    for tick in range(600):
        position = (rng.gauss(0, sigma), 0.0, 0.0)
        (reading,) = intake.readings([TrackerSample("1", round(tick / 60 * 1e9), position)])
    return reading.position != position


@pytest.mark.parametrize(("sigma", "above_mm", "expected"), [(0.005, 2.0, True), (0.001, 2.0, False), (0.001, 0, True)])
def test_smoothing_is_for_trackers_that_tremble(sigma, above_mm, expected):
    settings = OneEuroSettings(noise_above_mm=above_mm)
    # Two of three coordinates are still: the measured noise is that of all three.
    assert smoothed(sigma * math.sqrt(3), settings) is expected
