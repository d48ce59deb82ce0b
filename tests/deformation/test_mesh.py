"""Meshes: what must hold for any, on shapes whose answers are known, and on random ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deformation.mesh import (
    Mesh,
    all_quads,
    boundary_edges,
    components,
    edges,
    euler_characteristic,
    is_closed,
    surface_area,
    vertex_normals,
    volume,
)
from deformation.subdivision import catmull_clark, subdivision_matrix

_CUBE_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


def cube(size: float = 1.0) -> Mesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    return all_quads(corners * size, _CUBE_QUADS)


def sheet() -> Mesh:
    """Two quads and a triangle: an open strip."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [3, 0.5, 0]], float)
    return Mesh(vertices, np.array([[0, 1, 4, 3], [1, 2, 5, 4]]), np.array([[2, 6, 5]]))


def test_cube():
    mesh = cube(2.0)
    assert is_closed(mesh)
    assert euler_characteristic(mesh) == 2
    assert volume(mesh) == pytest.approx(8.0)
    assert surface_area(mesh) == pytest.approx(24.0)
    assert len(edges(mesh)) == 12
    assert len(boundary_edges(mesh)) == 0


def test_open_sheet_has_a_rim():
    mesh = sheet()
    assert not is_closed(mesh)
    assert len(boundary_edges(mesh)) == 7
    assert euler_characteristic(mesh) == 1


def test_one_flipped_face_is_not_closed():
    quads = _CUBE_QUADS.copy()
    quads[2] = quads[2, ::-1]
    assert not is_closed(all_quads(cube().vertices, quads))


def test_pieces_are_counted():
    mesh = cube()
    two = all_quads(np.concatenate([mesh.vertices, mesh.vertices + 5]), np.concatenate([_CUBE_QUADS, _CUBE_QUADS + 8]))
    piece = components(two)
    assert piece.max() == 1
    assert len(set(piece[:8])) == len(set(piece[8:])) == 1


def test_arrays_are_read_only_and_their_own():
    vertices = cube().vertices.copy()
    mesh = all_quads(vertices, _CUBE_QUADS)
    vertices[0] = 9
    assert mesh.vertices[0, 0] == 0
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1


@given(st.integers(0, 2**32 - 1))
def test_normals_turn_with_the_mesh(seed: int):
    random = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    mesh = sheet()
    vertices = mesh.vertices + random.normal(size=mesh.vertices.shape) * 0.1
    turned = vertex_normals(vertices @ turn.T + 3.0, mesh.triangulated)
    assert np.allclose(turned, vertex_normals(vertices, mesh.triangulated) @ turn.T, atol=1e-9)


def test_a_vertex_without_area_has_no_normal():
    normals = vertex_normals(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))
    assert np.array_equal(normals, np.zeros((3, 3)))


def test_subdivided_cube_has_the_published_points():
    fine = catmull_clark(cube())
    assert len(fine.vertices) == 8 + 12 + 6
    assert np.allclose(fine.vertices[0], 2 / 9)
    assert np.allclose(sorted(fine.vertices[8]), [1 / 8, 1 / 8, 1 / 2])
    assert is_closed(fine)
    assert euler_characteristic(fine) == 2
    assert volume(fine) > 0


def test_subdivision_keeps_a_flat_rim_straight_and_planes_plane():
    fine = catmull_clark(sheet(), levels=2)
    assert np.allclose(fine.vertices[:, 2], 0)
    assert len(fine.triangles) == 0
    on_bottom = np.sort(fine.vertices[np.abs(fine.vertices[:, 1]) < 1e-9, 0])
    assert np.allclose(on_bottom, [0.75, 1.0, 1.25])  # away from its rounded corners the B-spline rim stays straight


def test_subdivision_weights_sum_to_one_with_a_loose_vertex():
    mesh = Mesh(np.vstack([sheet().vertices, [[7, 7, 7]]]), sheet().quads, sheet().triangles)
    assert np.allclose(subdivision_matrix(mesh).sum(axis=1), 1)
    assert np.allclose(catmull_clark(mesh).vertices[7], 7)
