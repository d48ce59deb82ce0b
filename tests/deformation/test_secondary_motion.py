from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deformation.lattice import build_lattices
from deformation.secondary_motion import SecondaryMotion, SecondarySettings, _swing, swing_reference
from deformation.shape_matching import make_regions
from devices.errors import SettingError
from tests.deformation.bodies import two_legs

LATTICE = build_lattices(two_legs()[0], 0.06)[0]
REST = LATTICE.particles
REGIONS = make_regions(LATTICE, 2)
SOFT = np.clip(REST[:, 1] + 0.6, 0, 1)
SETTINGS = SecondarySettings(delta=0.7, frequency_hz=3, damping_ratio=0.3)


def flesh(softness: np.ndarray = SOFT) -> SecondaryMotion:
    return SecondaryMotion(REGIONS, softness, LATTICE.cell_size)


def follow(motion: SecondaryMotion, skin: np.ndarray, dt_s: float, how: SecondarySettings = SETTINGS) -> np.ndarray:
    shown = np.empty_like(skin)
    motion.follow(skin, dt_s, how, shown)
    return shown


def sway(time_s: float) -> np.ndarray:
    """The rest pose swung sideways for a second, eased in and out, then still."""
    t = min(time_s, 1.0)
    return REST + np.array([0.2 * np.sin(2 * np.pi * t) * np.sin(np.pi * t) ** 2, 0, 0])


def offsets(fps: float, duration_s: float, how: SecondarySettings = SETTINGS) -> tuple[np.ndarray, np.ndarray]:
    """Times, and metres sideways from the skin to what is shown in the mean."""
    motion, times = flesh(), np.arange(0, duration_s, 1 / fps)
    return times, np.array([(follow(motion, sway(t), 1 / fps, how) - sway(t))[:, 0].mean() for t in times])


def test_flesh_swings_and_settles_on_the_skin() -> None:
    _, distance = offsets(60, 4)
    assert np.abs(distance).max() > 0.005
    assert abs(distance[-1]) < 1e-5


def test_what_is_shown_does_not_depend_on_the_display_rate() -> None:
    grid = np.arange(0.1, 1.4, 0.05)
    shown = [np.interp(grid, *offsets(fps, 1.5)) for fps in (30, 60, 144)]
    scale = np.abs(shown[1]).max()
    assert np.abs(shown[0] - shown[1]).max() < 0.05 * scale
    assert np.abs(shown[2] - shown[1]).max() < 0.05 * scale


def test_frequency_and_damping_are_those_of_a_free_swing() -> None:
    how = SecondarySettings(delta=0.6, frequency_hz=2.0, damping_ratio=0.05)
    motion = flesh(np.ones(len(REST)))
    follow(motion, REST, 1 / 60, how)
    motion.push(np.array([0.3, 0.0, 0.0]))
    swing = np.array([(follow(motion, REST, 1 / 60, how) - REST)[:, 0].mean() for _ in range(180)])
    crossings = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    assert 60 / np.diff(crossings).mean() == pytest.approx(2.0, rel=0.05)
    peaks = [swing[a:b].max() for a, b in pairwise(crossings)]
    decay = np.log(np.array(peaks[:-1]) / np.array(peaks[1:])).mean()
    assert decay / np.hypot(2 * np.pi, decay) == pytest.approx(0.05, rel=0.25)


def test_no_delta_and_no_softness_are_the_skin_itself() -> None:
    for motion, how in ((flesh(), replace(SETTINGS, delta=0.0)), (flesh(np.zeros(len(REST))), SETTINGS)):
        for t in np.arange(0, 0.5, 1 / 60):
            np.testing.assert_allclose(follow(motion, sway(t), 1 / 60, how), sway(t), atol=1e-15)


@pytest.mark.parametrize("fps", [30, 60, 144])
def test_a_body_that_moves_evenly_takes_its_flesh_along(fps: int) -> None:
    motion = flesh()
    for frame in range(40):
        skin = REST + frame / fps * np.array([4.0, 0.5, 0.0])
        np.testing.assert_allclose(follow(motion, skin, 1 / fps), skin, atol=1e-9)


def test_a_uniform_push_keeps_a_soft_body_in_shape() -> None:
    how = SecondarySettings(delta=0.8, damping_ratio=0.0)
    motion = flesh(np.ones(len(REST)))
    follow(motion, REST, 1 / 60, how)
    motion.push(np.array([0.0, 0.2, 0.0]))
    for _ in range(10):
        moved = follow(motion, REST, 1 / 60, how) - REST
        np.testing.assert_allclose(moved, np.broadcast_to(moved.mean(axis=0), moved.shape), atol=1e-9)


@pytest.mark.parametrize("gap_s", [2.0, 0.2])
def test_a_stall_and_a_teleport_are_survived(gap_s: float) -> None:
    motion = flesh()
    for t in np.arange(0, 0.4, 1 / 60):
        follow(motion, sway(t), 1 / 60)
    far = sway(0.4) + np.array([30.0, 0, 5.0])
    np.testing.assert_allclose(follow(motion, far, gap_s), far, atol=1e-12)
    np.testing.assert_allclose(follow(motion, far, 1 / 60), far, atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0, 0.95), st.floats(0.5, 12), st.floats(0, 2)), min_size=5, max_size=5),
    st.integers(0, 99),
)
def test_no_change_of_settings_makes_it_blow_up(changes: list[tuple[float, float, float]], seed: int) -> None:
    rng, motion = np.random.default_rng(seed), flesh()
    for values in changes:
        how = SecondarySettings(*values)
        for _ in range(8):
            skin = REST + 0.1 * rng.normal(size=3)
            shown = follow(motion, skin, 1 / 60, how)
            assert np.linalg.norm(shown - skin, axis=1).max() <= 1.5 * LATTICE.cell_size + 1e-9


def test_a_skin_of_no_number_is_forgotten_again() -> None:
    motion = flesh()
    follow(motion, REST, 1 / 60)
    follow(motion, np.full_like(REST, np.nan), 1 / 60)
    np.testing.assert_array_equal(follow(motion, REST, 1 / 60), REST)


@pytest.mark.parametrize("seed", range(5))
def test_a_step_is_its_reference(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, v, skin, speed, goals = (0.2 * rng.normal(size=(50, 3)) for _ in range(5))
    softness = np.clip(rng.uniform(-0.2, 1, 50), 0, 1)
    how = SecondarySettings(delta=0.9, gravity_m_s2=(0.0, -9.8, 0.0))
    expected = swing_reference(x, v, skin, speed, goals, softness, how, 0.3)
    gravity, out = np.array(how.gravity_m_s2), np.empty_like(x)
    _swing(
        x,
        v,
        skin,
        speed,
        goals,
        softness,
        how.delta,
        2 * np.pi * how.frequency_hz,
        how.damping_ratio,
        gravity,
        0.3,
        out,
    )
    np.testing.assert_allclose(x, expected[0], atol=1e-12)
    np.testing.assert_allclose(v, expected[1], atol=1e-12)
    np.testing.assert_allclose(out, x - skin, atol=1e-12)


def test_gravity_pulls_the_soft_down() -> None:
    how = replace(SETTINGS, gravity_m_s2=(0.0, -9.8, 0.0), damping_ratio=1.0)
    motion = flesh()
    for _ in range(200):
        shown = follow(motion, REST, 1 / 60, how)
    sag = REST[:, 1] - shown[:, 1]
    assert sag.max() > 0.005
    assert sag.min() > -1e-3


@pytest.mark.parametrize("wrong", [{"delta": 1.0}, {"frequency_hz": 0}, {"damping_ratio": -1}, {"delta": float("nan")}])
def test_settings_out_of_range_are_named(wrong: dict[str, float]) -> None:
    with pytest.raises(SettingError, match=next(iter(wrong))):
        SecondarySettings(**wrong)
