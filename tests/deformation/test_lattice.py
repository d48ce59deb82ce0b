import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from deformation.lattice import CORNERS, Lattice, build_lattices, cell_size_for, expected_cell_size, trilinear
from deformation.mesh import Mesh, is_closed, volume
from deformation.surface import interpolate_reference
from deformation.voxels import voxelise
from devices.errors import SettingError
from tests.deformation.bodies import box, joined, two_legs


def pieces(lattice: Lattice) -> int:
    first = np.repeat(lattice.cells[:, 0], 7)
    size = len(lattice.particles)
    graph = coo_matrix((np.ones(len(first)), (first, lattice.cells[:, 1:].reshape(-1))), shape=(size, size))
    return connected_components(graph, directed=False)[0]


def test_a_box_is_filled_with_cells() -> None:
    lattice, fine, parents = build_lattices(box((0, 0, 0), (1, 1, 1)), 0.26)
    assert len(lattice.cells) == 4**3
    assert len(lattice.particles) == 5**3
    assert len(fine.cells) == 8**3
    np.testing.assert_array_equal(np.bincount(parents), np.full(64, 8))


def test_voxels_fill_the_volume() -> None:
    mesh = box((0, 0, 0), (1, 0.7, 0.4))
    voxels = voxelise(mesh.vertices, mesh.triangulated, np.full(3, -0.01), 0.02, (52, 40, 24))
    assert voxels.closed
    assert len(voxels.solid) * 0.02**3 == pytest.approx(0.28, rel=0.05)


def test_voxels_of_an_open_or_inside_out_shell_are_still_its_inside() -> None:
    mesh = box((0, 0, 0), (1, 1, 1), 10)
    lidless = Mesh(mesh.vertices, mesh.quads[5:], mesh.triangles)
    turned = mesh.quads.copy()
    turned[::3] = turned[::3, ::-1]
    for shell in (lidless, Mesh(mesh.vertices, turned, mesh.triangles)):
        voxels = voxelise(shell.vertices, shell.triangulated, np.full(3, -0.02), 0.05, (21, 21, 21))
        assert not voxels.closed
        assert len(voxels.solid) * 0.05**3 == pytest.approx(1, rel=0.1)


def test_a_body_within_a_body_hangs_together() -> None:
    lattice, _, _ = build_lattices(joined(box((0, 0, 0), (1, 1, 1)), box((0.3, 0.3, 0.3), (0.6, 0.6, 0.6))), 0.2)
    assert pieces(lattice) == 1


def test_legs_that_share_cells_of_the_grid_share_no_particles() -> None:
    mesh, _, _ = two_legs(gap=0.012)
    assert is_closed(mesh)
    assert volume(mesh) > 0
    lattice, fine, _ = build_lattices(mesh, 0.04)
    for cells in (lattice, fine):
        assert pieces(cells) == 1
        low = mesh.vertices[:, 1] < -0.05
        left = cells.cells[cells.vertex_cells[low & (mesh.vertices[:, 0] > 0)]]
        right = cells.cells[cells.vertex_cells[low & (mesh.vertices[:, 0] < 0)]]
        assert not set(left.ravel()) & set(right.ravel())
    assert len(np.unique(lattice.particles.round(6), axis=0)) < len(lattice.particles)


def test_two_boxes_apart_are_two_pieces_at_any_cell_size() -> None:
    mesh = joined(box((0, 0, 0), (0.3, 1, 0.3)), box((0.31, 0, 0), (0.6, 1, 0.3)))
    for size in (0.05, 0.11, 0.2):
        assert pieces(build_lattices(mesh, size)[0]) == 2


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(0.1, 1.5), min_size=3, max_size=3),
    st.floats(0.05, 0.3),
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
)
def test_every_vertex_rides_where_it_stands(size: list[float], cell: float, place: list[float]) -> None:
    low = np.array(place)
    mesh = box(tuple(low), tuple(low + size))
    for lattice in build_lattices(mesh, cell)[:2]:
        assert lattice.vertex_fractions.min() > -1e-6
        assert lattice.vertex_fractions.max() < 1 + 1e-6
        np.testing.assert_allclose(interpolate_reference(lattice, lattice.particles), mesh.vertices, atol=1e-12)
        edges = lattice.particles[lattice.cells] - lattice.particles[lattice.cells[:, :1]]
        np.testing.assert_allclose(edges, np.broadcast_to(CORNERS * lattice.cell_size, edges.shape), atol=1e-9)


@given(st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_trilinear_weights_are_a_partition_of_unity_and_keep_linear_fields(fraction: list[float]) -> None:
    weights = trilinear(np.array([fraction]))
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(), 1)
    np.testing.assert_allclose(weights[0] @ CORNERS, fraction, atol=1e-12)


def test_a_particle_count_is_met() -> None:
    mesh, _, _ = two_legs()
    for count in (400, 1000):
        found = len(build_lattices(mesh, cell_size_for(mesh, count))[0].particles)
        assert found == pytest.approx(count, rel=0.05)
        guessed = len(build_lattices(mesh, expected_cell_size(mesh, count))[0].particles)
        assert guessed == pytest.approx(count, rel=0.6)


@pytest.mark.parametrize("size", [0, -0.1, float("nan"), 1e-5])
def test_impossible_cell_sizes_are_named(size: float) -> None:
    with pytest.raises(SettingError, match="cell size"):
        build_lattices(box((0, 0, 0), (1, 1, 1)), size)


def test_a_mesh_without_faces_is_refused() -> None:
    with pytest.raises(SettingError, match="no faces"):
        build_lattices(Mesh(np.zeros((3, 3)), np.empty((0, 4)), np.empty((0, 3))), 0.1)
