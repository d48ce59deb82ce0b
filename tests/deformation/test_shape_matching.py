import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from deformation.lattice import build_lattices
from deformation.polar import polar, polar_near_identity
from deformation.shape_matching import Regions, ShapeMatcher, goals_reference, make_regions, region_matrix
from devices.errors import SettingError
from tests.deformation.bodies import box, two_legs

LATTICE = build_lattices(two_legs()[0], 0.06)[0]
REST = LATTICE.particles


def mixed() -> Regions:
    return make_regions(LATTICE, 1 + np.arange(len(REST)) % 3)


REGIONS = {"1": make_regions(LATTICE, 1), "2": make_regions(LATTICE, 2), "mixed": mixed()}
names = st.sampled_from(sorted(REGIONS))


def shaken(seed: int, size: float) -> np.ndarray:
    return REST + size * np.random.default_rng(seed).normal(size=REST.shape)


@settings(max_examples=30, deadline=None)
@given(names, st.integers(0, 1000), st.floats(0, 0.03))
def test_the_kernel_is_its_reference(name: str, seed: int, size: float) -> None:
    positions = shaken(seed, size)
    goals = ShapeMatcher(REGIONS[name]).goals(positions, REST)
    np.testing.assert_allclose(goals, goals_reference(positions, REST, REGIONS[name]), atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(names, st.integers(0, 1000))
def test_momentum_and_angular_momentum_are_conserved(name: str, seed: int) -> None:
    positions, regions = shaken(seed, 0.01), REGIONS[name]
    pull = regions.shares[:, None] * (ShapeMatcher(regions).goals(positions, REST) - positions)
    np.testing.assert_allclose(pull.sum(axis=0), 0, atol=1e-10)
    np.testing.assert_allclose(np.cross(positions, pull).sum(axis=0), 0, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(names, st.lists(st.floats(-3, 3), min_size=6, max_size=6))
def test_a_rigidly_moved_body_is_at_its_goal(name: str, rigid: list[float]) -> None:
    moved = REST @ Rotation.from_rotvec(rigid[:3]).as_matrix().T + rigid[3:]
    goals = ShapeMatcher(REGIONS[name]).goals(moved, REST)
    np.testing.assert_allclose(goals, moved, atol=1e-7)


@pytest.mark.parametrize("width", [1, 2, 3])
def test_a_region_holds_what_is_within_its_half_width_along_the_lattice(width: int) -> None:
    lattice = build_lattices(box((0, 0, 0), (1, 1, 1)), 0.11)[0]
    reached = region_matrix(lattice.cells, np.full(len(lattice.particles), width)).toarray() > 0
    apart = np.abs(lattice.particles[:, None] - lattice.particles[None]).max(axis=2) / lattice.cell_size
    np.testing.assert_array_equal(reached, apart < width + 0.5)


def test_regions_do_not_reach_across_a_gap() -> None:
    left = (REST[:, 0] > 0.02) & (REST[:, 1] < -0.3)
    right = (REST[:, 0] < -0.02) & (REST[:, 1] < -0.3)
    reached = region_matrix(LATTICE.cells, np.full(len(REST), 2)).toarray() > 0
    assert not reached[np.ix_(left, right)].any()


@given(st.lists(st.floats(-1.2, 1.2), min_size=3, max_size=3), st.lists(st.floats(0.05, 2), min_size=3, max_size=3))
def test_the_quick_polar_decomposition_is_the_other(vector: list[float], sizes: list[float]) -> None:
    stretch = Rotation.from_rotvec([0.3, 0.5, -0.2]).as_matrix()
    matrix = Rotation.from_rotvec(vector).as_matrix() @ stretch @ np.diag(sizes) @ stretch.T
    numbers = tuple(float(x) for x in matrix.ravel())
    np.testing.assert_allclose(polar_near_identity(numbers)[1], polar(numbers)[1], atol=1e-9)


@pytest.mark.parametrize("width", [0, 6, -1])
def test_half_widths_out_of_range_are_named(width: int) -> None:
    with pytest.raises(SettingError, match="half-width"):
        make_regions(LATTICE, width)
