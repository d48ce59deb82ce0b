import numpy as np
import pytest

from devices.sample import ROLES
from reconstruction.tracker_filter import TrackerFilter

TIME = np.arange(240) / 60


def limbs() -> np.ndarray:
    """Trackers (T, 6, 3) on limbs that swing about once a second while the body goes along."""
    lag = np.arange(18).reshape(6, 3)
    swing = 0.3 * np.sin(2 * np.pi * TIME[:, None, None] + lag)
    return swing + 1.3 * TIME[:, None, None] * [0.0, 0.0, 1.0]


def filtered(readings: np.ndarray, noise_m: float) -> np.ndarray:
    tracker_filter = TrackerFilter(60)
    return np.array([tracker_filter.filtered(now, noise_m) for now in readings])


def jitter(positions: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(positions, 3, axis=0), axis=-1).mean())


@pytest.mark.parametrize("noise_m", [0.001, 0.005])
def test_noise_is_taken_out_and_nothing_else(noise_m):
    readings = limbs() + np.random.default_rng(0).normal(0, noise_m, (240, 6, 3))
    left, was = (filtered(readings, noise_m) - limbs())[30:], (readings - limbs())[30:]
    assert jitter(left) < 0.6 * jitter(was)
    assert np.std(left) < 0.95 * np.std(was)


def test_constant_acceleration_comes_through_without_lag():
    thrown = np.tile((0.5 * 9.81 * TIME**2)[:, None, None], (1, 6, 3))
    np.testing.assert_allclose(filtered(thrown, 0.005)[120:], thrown[120:], atol=1e-4)


def test_without_noise_every_reading_is_taken_as_it_is():
    np.testing.assert_allclose(filtered(limbs(), 0.0), limbs(), atol=1e-12)


def test_a_tracker_that_was_missing_begins_anew_and_hinders_no_other():
    readings = limbs()
    readings[100:150, 2] = np.nan
    found, whole = filtered(readings, 0.002), filtered(limbs(), 0.002)
    assert np.isnan(found[100:150, 2]).all()
    np.testing.assert_allclose(found[150, 2], readings[150, 2], atol=1e-12)
    others = np.arange(len(ROLES)) != 2
    np.testing.assert_array_equal(found[:, others], whole[:, others])


def test_a_jump_is_followed_at_once():
    readings = limbs()
    readings[100:] += 1.0
    found = filtered(readings, 0.002)
    np.testing.assert_allclose(found[100], readings[100], atol=1e-12)
    assert np.abs(found[101:] - readings[101:]).max() < 0.01
