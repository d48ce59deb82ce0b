"""Triangles joined to quads: a cut quad mesh comes back, and nothing is joined that makes no quad."""

import numpy as np

from deformation.isocurves_pairing import paired_quads
from deformation.mesh import Mesh, surface_area
from tests.deformation.bodies import box
from tests.deformation.test_isocurves import cylinder, torus

NO_QUADS = np.empty((0, 4), np.int32)


def as_sets(mesh: Mesh) -> set[tuple[int, ...]]:
    return {tuple(sorted(quad)) for quad in mesh.quads.tolist()}


def test_a_cut_quad_mesh_comes_back() -> None:
    for mesh in (cylinder(12, 20), torus(12, 40), box((0, 0, 0), (1, 1, 1), 5)):
        shuffled = np.random.default_rng(3).permutation(mesh.triangulated)
        paired, share = paired_quads(Mesh(mesh.vertices, NO_QUADS, shuffled))
        assert share == 1.0
        assert as_sets(paired) == as_sets(mesh)


def test_faces_keep_their_side_and_area() -> None:
    mesh = torus(12, 40)
    paired, _ = paired_quads(Mesh(mesh.vertices, NO_QUADS, mesh.triangulated))
    assert surface_area(paired) == surface_area(mesh) or abs(surface_area(paired) / surface_area(mesh) - 1) < 0.01
    sides = {tuple(s) for s in mesh.half_edges.tolist()}
    assert {tuple(s) for s in paired.half_edges.tolist()} == sides


def test_every_triangle_is_kept_once() -> None:
    random = np.random.default_rng(5)
    vertices = random.normal(size=(40, 3))
    triangles = np.unique(np.sort([random.choice(40, 3, replace=False) for _ in range(60)], axis=1), axis=0)
    paired, share = paired_quads(Mesh(vertices, NO_QUADS, triangles))
    assert 2 * len(paired.quads) + len(paired.triangles) == len(triangles)
    assert share == 2 * len(paired.quads) / len(triangles)


def test_long_slivers_are_no_quads() -> None:
    fan = np.array([[0, 0, 0], [10, 0, 0], [10, 1, 0], [0, 0.5, 3.0]])
    paired, share = paired_quads(Mesh(fan, NO_QUADS, np.array([[0, 1, 2], [0, 2, 3]])))
    assert share == 0
    assert len(paired.triangles) == 2
