"""Beams: kernels agree with plain matrices, energy is kept without damping, examples are met exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from deformation.beam import BeamSettings, BeamSkin, deforming_reference, fourth_difference, spacings
from deformation.inbetween import ease, inbetween
from deformation.inbetween_skin import skin_curves
from deformation.inbetween_target import turning_way
from deformation.isocurves import IsoCurves, iso_curves
from devices.errors import SettingError
from tests.deformation.bodies import box
from tests.deformation.test_isocurves import cylinder, torus


def one_curve(count: int, closed: bool) -> tuple[IsoCurves, np.ndarray]:
    """A curve of so many vertices on a circle of radius 0.1, and their places."""
    turn = 2 * np.pi * np.arange(count) / (count if closed else count + 3)
    points = 0.1 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    members = np.arange(count, dtype=np.int32)
    empty = np.empty(0, np.int32)
    return IsoCurves(members, np.array([0, count], np.int32), np.array([closed]), empty), points


def plain_step(
    matrix: np.ndarray, drag: float, tie: float, dt: float, force: np.ndarray, state: tuple
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newmark's step with full matrices."""
    e, v, a = state
    e, v = e + dt * v + dt * dt / 4 * a, v + dt / 2 * a
    size = len(e)
    system = (1 + drag * dt / 2) * np.eye(size) + dt * dt / 4 * (matrix + tie * np.eye(size))
    a = np.linalg.solve(system, force - drag * v - (matrix + tie * np.eye(size)) @ e)
    return e + dt * dt / 4 * a, v + dt / 2 * a, a


@settings(max_examples=40, deadline=None)
@given(st.integers(3, 24), st.booleans(), st.floats(0.001, 0.05), st.floats(0, 1), st.integers(0, 2**31))
def test_kernels_are_plain_matrices(count: int, closed: bool, dt: float, damping: float, seed: int) -> None:
    curves, rest = one_curve(count, closed)
    random = np.random.default_rng(seed)
    chosen = BeamSettings(damping_ratio=damping)
    skin = BeamSkin(curves, rest, dt, chosen)
    free = np.arange(count) if closed else np.arange(1, count - 1)
    columns = np.eye(count)
    stiffness = chosen.bending / spacings(curves, rest)[0] ** 4
    matrix = stiffness * np.stack([fourth_difference(c[:, None], closed)[:, 0] for c in columns], axis=1)[free][:, free]
    w = 2 * np.pi * chosen.frequency_hz
    zero = np.zeros((len(free), 3))
    state, out = (zero, zero, zero), np.empty((count, 3))
    for _ in range(3):
        target, velocity = random.normal(size=(2, count, 3))
        skin.step(target, velocity, out)
        drag = 2 * damping * w
        deforming = deforming_reference(rest + target, velocity)
        state = plain_step(matrix, drag, w * w, dt, -drag * deforming[free], state)
        expected = np.zeros((count, 3))
        expected[free] = state[0]
        np.testing.assert_allclose(out - target, expected, atol=1e-9 * (1 + np.abs(expected).max()))


@pytest.mark.parametrize("closed", [True, False])
def test_fourth_differences_are_those_of_waves(closed: bool) -> None:
    count = 400
    if closed:
        v = 2 * np.pi * np.arange(count) / count
        wave, step, exact = np.sin(3 * v), v[1], 81 * np.sin(3 * v)
    else:
        # x^2 (1 - x)^2 is fixed in place and slope at both ends; its fourth derivative is 24.
        v = np.linspace(0, 1, count)
        wave, step, exact = v**2 * (1 - v) ** 2, v[1], np.full(count, 24.0)
    found = fourth_difference(wave[:, None], closed)[:, 0] / step**4
    inner = slice(None) if closed else slice(2, -2)
    np.testing.assert_allclose(found[inner], exact[inner], atol=0.02 * np.abs(exact).max())


@pytest.mark.parametrize("dt", [0.001, 0.033, 0.5])
def test_without_damping_energy_is_kept(dt: float) -> None:
    mesh = cylinder(12, 15)
    skin = BeamSkin(iso_curves(mesh), mesh.vertices, dt, BeamSettings(damping_ratio=0))
    skin.push(np.random.default_rng(1).normal(size=(len(skin.lag()), 3)))
    still, out = np.zeros_like(mesh.vertices), np.empty_like(mesh.vertices)
    before = skin.energy()
    for _ in range(200):
        skin.step(still, still, out)
    assert skin.energy() == pytest.approx(before, rel=1e-7)
    assert np.abs(out).max() > 0


def test_a_pushed_ring_swings_at_its_frequency() -> None:
    curves, rest = one_curve(16, True)
    skin = BeamSkin(curves, rest, 1e-3, BeamSettings(frequency_hz=4, damping_ratio=0))
    skin.push(np.tile([1.0, 0, 0], (16, 1)))
    still, out = np.zeros_like(rest), np.empty_like(rest)
    path = []
    for _ in range(1000):
        skin.step(still, still, out)
        path.append(out[0, 0])
    crossings = np.flatnonzero((np.array(path[:-1]) < 0) & (np.array(path[1:]) >= 0))
    assert np.diff(crossings).mean() == pytest.approx(250, abs=1)
    assert max(path) == pytest.approx(1 / (2 * np.pi * 4), rel=1e-3)


def test_damped_lag_dies() -> None:
    mesh = torus(8, 12)
    skin = BeamSkin(iso_curves(mesh), mesh.vertices, 1 / 60)
    skin.push(np.ones((len(skin.lag()), 3)))
    still, out = np.zeros_like(mesh.vertices), np.empty_like(mesh.vertices)
    before = skin.energy()
    for _ in range(120):
        skin.step(still, still, out)
    assert skin.energy() < 1e-6 * before


@settings(max_examples=10, deadline=None)
@given(st.integers(1, 9), st.floats(0.05, 5), st.integers(0, 2**31))
def test_examples_are_met_exactly(frames: int, duration_s: float, seed: int) -> None:
    mesh = box((0, 0, 0), (1, 1, 1), 4)
    random = np.random.default_rng(seed)
    poses = [mesh.vertices, *(mesh.vertices + 0.2 * random.normal(size=(2, *mesh.vertices.shape)))]
    shapes = list(inbetween(mesh, poses, frames, duration_s))
    assert len(shapes) == 2 * (frames + 1) + 1
    for pose, shape in zip(poses, shapes[:: frames + 1], strict=True):
        assert np.array_equal(pose, shape)


def test_shapes_between_neither_jump_nor_overshoot_wildly() -> None:
    mesh = cylinder(12, 15)
    end = mesh.vertices + np.array([0, 0.3, 0])
    heights = [float((s - mesh.vertices)[:, 1].mean()) for s in inbetween(mesh, [mesh.vertices, end], 19)]
    assert max(heights) < 0.33
    assert min(heights) > -0.03
    assert np.abs(np.diff(heights)).max() < 3 * 0.3 / 20


def test_a_limb_that_bends_keeps_its_length() -> None:
    straight, bent = cylinder(16, 30), cylinder(16, 30, np.radians(100))
    way = turning_way(straight, bent.vertices)
    for share in (0.0, 0.2, 0.5, 0.8, 1.0):
        end = way(share)[-16:].mean(axis=0) - [0.5, 0, 0]
        assert np.linalg.norm(end) == pytest.approx(0.5, abs=0.015)
    np.testing.assert_allclose(way(0.0), straight.vertices, atol=1e-9)
    np.testing.assert_allclose(way(1.0), bent.vertices, atol=1e-9)


def test_what_turns_as_a_whole_only_turns() -> None:
    mesh = box((0, 0, 0), (1, 0.5, 0.2), 3)
    turn = Rotation.from_rotvec([0.3, 1.1, -0.4])
    half = turning_way(mesh, turn.apply(np.array(mesh.vertices)))(0.5)
    expected = Rotation.from_rotvec(np.array([0.3, 1.1, -0.4]) / 2).apply(np.array(mesh.vertices))
    np.testing.assert_allclose(half - half.mean(axis=0), expected - expected.mean(axis=0), atol=1e-9)


def test_ease_is_at_rest_at_both_ends() -> None:
    assert [ease(x) for x in (0.0, 0.5, 1.0)] == [0.0, 0.5, 1.0]
    assert ease(0.01) < 1e-4
    assert 1 - ease(0.99) < 1e-4


def test_what_bends_as_skin_are_rings_around_limbs() -> None:
    mesh = cylinder(12, 15)
    rings, shown = skin_curves(mesh)
    assert rings.closed.all()
    assert len(rings) == 13
    assert shown.max() == 1
    np.testing.assert_array_equal(shown[:12], 0)
    # On a torus the short way round is the ring, though the long one closes too.
    around = skin_curves(torus(6, 20))[0]
    assert set(np.diff(around.starts)) == {6}


def test_rigid_motion_leaves_no_lag() -> None:
    mesh = torus(8, 12)
    skin, out = BeamSkin(iso_curves(mesh), mesh.vertices, 1 / 60), np.empty_like(mesh.vertices)
    velocity = np.array([1.0, -2.0, 0.5]) + np.cross([0.3, 2.0, -1.0], mesh.vertices)
    skin.step(np.zeros_like(mesh.vertices), velocity, out)
    assert np.abs(skin.lag()).max() < 1e-6
    skin.step(np.zeros_like(mesh.vertices), mesh.vertices * [1.0, 2.0, 3.0], out)
    assert np.abs(skin.lag()).max() > 1e-4


def test_a_step_may_have_a_length_of_its_own() -> None:
    curves, rest = one_curve(12, True)
    random = np.random.default_rng(4)
    changing, fixed = BeamSkin(curves, rest, 0.5), BeamSkin(curves, rest, 0.02)
    out = np.empty((2, 12, 3))
    for _ in range(3):
        target, velocity = random.normal(size=(2, 12, 3))
        changing.step(target, velocity, out[0], 0.02)
        fixed.step(target, velocity, out[1])
        np.testing.assert_array_equal(out[0], out[1])
    changing.rest()
    assert not changing.lag().any()


def test_wrong_settings_are_named() -> None:
    mesh = cylinder(6, 6)
    with pytest.raises(SettingError, match="density_kg_m3"):
        BeamSettings(density_kg_m3=0)
    with pytest.raises(SettingError, match="damping_ratio"):
        BeamSettings(damping_ratio=3)
    with pytest.raises(SettingError, match="two or more"):
        next(inbetween(mesh, [mesh.vertices], 3))
    with pytest.raises(SettingError, match="above 0"):
        BeamSkin(iso_curves(mesh), mesh.vertices, 0.0)
