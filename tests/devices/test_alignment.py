"""Two devices find each other from one wave."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from devices.alignment import TrackerPath, align
from devices.errors import DeviceError


def circles(times):
    return np.stack([0.4 * np.sin(2 * times), 1.2 + 0.3 * np.cos(3 * times), 0.3 * np.sin(1.1 * times)], 1)


def device_path(rotation: Rotation, translation, rate_hz: float, noise_m: float, seed: int) -> TrackerPath:
    rng = np.random.default_rng(seed)
    times = np.arange(0.013, 6, 1 / rate_hz)
    world = circles(times) + rng.normal(0, noise_m, (len(times), 3))
    return TrackerPath(times, rotation.inv().apply(world - translation))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_any_place_is_found_within_the_noise(seed):
    rng = np.random.default_rng(seed)
    rotation, translation = Rotation.random(random_state=seed), rng.uniform(-3, 3, 3)
    times = np.arange(0, 6, 1 / 60)
    first = TrackerPath(times, circles(times) + rng.normal(0, 0.002, (len(times), 3)))
    found = align(first, device_path(rotation, translation, 100, 0.002, seed))
    turned = Rotation.from_quat(found.room.rotation)
    assert (turned * rotation.inv()).magnitude() < 0.005
    assert found.room.translation == pytest.approx(tuple(translation), abs=0.01)
    assert 0.003 < found.residual_m < 0.008


def test_outliers_and_gaps_are_set_aside():
    times = np.concatenate([np.arange(0, 2, 1 / 60), np.arange(3, 6, 1 / 60)])
    second = device_path(Rotation.identity(), np.zeros(3), 60, 0.0, 0)
    second.positions[::10] += 1.0
    found = align(TrackerPath(times, circles(times)), second)
    assert found.room.translation == pytest.approx((0, 0, 0), abs=1e-3)
    assert found.residual_m < 1e-3
    assert found.used == pytest.approx(0.9, abs=0.02)


def test_a_wave_along_a_line_or_too_short_is_refused():
    times = np.arange(0, 6, 1 / 60)
    line = TrackerPath(times, np.outer(np.sin(times), [1.0, 0.2, 0.0]))
    with pytest.raises(DeviceError, match="is a line"):
        align(line, line)
    short = TrackerPath(times[:10], circles(times[:10]))
    for path in (short, TrackerPath(np.empty(0), np.empty((0, 3)))):
        with pytest.raises(DeviceError, match="long enough"):
            align(path, short)
