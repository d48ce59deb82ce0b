"""The doctor's figures are those of the simulated faults."""

import numpy as np
import pytest

from devices.health import diagnose
from devices.sample import TrackerSample


def samples(seconds=10.0, rate=60.0, noise_m=0.0, jitter_s=0.0, lost=0.0, drift=0.0, speed=0.0, tracker="1"):
    rng = np.random.default_rng(0)
    made = []
    for i in range(round(seconds * rate)):
        t = i / rate
        place = rng.normal(0, noise_m, 3) + np.array([speed * t, 1.0, 0.0])
        hidden = rng.random() < lost
        arrival = t + 0.001 + abs(rng.normal(0, jitter_s))
        made.append(
            TrackerSample(
                tracker,
                round(arrival * 1e9),
                None if hidden else tuple(place.tolist()),
                device_time_s=t * (1 - drift),
                quality=0.9,
            )
        )
    return made


def test_a_good_tracker():
    (health,) = diagnose(samples(noise_m=0.001), 60)
    assert health.rate_hz == pytest.approx(60, rel=1e-3)
    assert health.lost == 0
    assert health.jitter_ms < 0.01
    assert health.noise_mm == pytest.approx(1.0 * 3**0.5, rel=0.15)
    assert health.quality == pytest.approx(0.9)
    assert health.verdict == "good"


@pytest.mark.parametrize(
    ("faults", "figure", "value", "said"),
    [
        ({"rate": 20.0}, "rate_hz", 20.0, "only 20 of 60"),
        ({"lost": 0.3}, "lost", 0.3, "not seen"),
        ({"noise_m": 0.02}, "noise_mm", 35.0, "trembles"),
        ({"jitter_s": 0.02}, "jitter_ms", 12.0, "unevenly"),
        ({"drift": 5e-4}, "drift_ppm", 500.0, "clock"),
    ],
)
def test_each_fault_is_measured_and_named(faults, figure, value, said):
    (health,) = diagnose(samples(seconds=20, **faults), 60)
    assert getattr(health, figure) == pytest.approx(value, rel=0.15)
    assert said in health.verdict


def test_noise_is_measured_at_rest_only():
    (moving,) = diagnose(samples(speed=1.0), 60)
    assert moving.noise_mm is None
    (rested,) = diagnose(samples(speed=1.0) + [_later(s) for s in samples(noise_m=0.002)], 60)
    assert rested.noise_mm == pytest.approx(2 * 3**0.5, rel=0.2)


def _later(sample: TrackerSample) -> TrackerSample:
    return TrackerSample(sample.tracker, sample.host_time_ns + 10_000_000_000, sample.position)


def test_trackers_are_told_apart_and_missed_samples_shared_out():
    first, second = diagnose(samples() + samples(tracker="2"), 60, missed=600)
    assert (first.tracker, second.tracker) == ("1", "2")
    assert first.lost == pytest.approx(1 / 3)
    assert diagnose([], 60) == []
