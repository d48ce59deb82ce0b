import numpy as np

from deformation.lattice import build_lattices
from deformation.mesh import Mesh, vertex_normals
from deformation.surface import Surface, normals_reference, seams
from tests.deformation.bodies import box


def tube(cut: bool, sides: int = 24) -> Mesh:
    """A round tube open at both ends, its last column of faces on vertices of their own where it is cut open."""
    columns = sides + 1 if cut else sides
    angle = 2 * np.pi * np.arange(columns) % (2 * np.pi * sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1).round(12)
    vertices = np.concatenate(
        [np.column_stack([0.1 * ring[:, 0], np.full(columns, y), 0.1 * ring[:, 1]]) for y in (0, 0.2, 0.4)]
    )
    quads = [
        [r * columns + a, (r + 1) * columns + a, (r + 1) * columns + (a + 1) % columns, r * columns + (a + 1) % columns]
        for r in range(2)
        for a in range(sides)
    ]
    return Mesh(vertices, np.array(quads, np.int32), np.empty((0, 3), np.int32))


def test_a_texture_seam_does_not_show_in_the_light():
    whole, cut = normals_reference(tube(cut=False), tube(cut=False).vertices), tube(cut=True)
    for row in range(3):
        seam = normals_reference(cut, cut.vertices)[[row * 25, row * 25 + 24]]
        np.testing.assert_allclose(seam, whole[[row * 24, row * 24]], atol=1e-9)
    assert np.abs(vertex_normals(cut.vertices, cut.triangulated)[0] - whole[0]).max() > 0.05


def test_a_hard_edge_stays_hard():
    mesh = box((0, 0, 0), (1, 1, 1), 2)
    quads = np.arange(mesh.quads.size, dtype=np.int32).reshape(-1, 4)
    apart = Mesh(mesh.vertices[mesh.quads.ravel()], quads, np.empty((0, 3), np.int32))
    normals = normals_reference(apart, apart.vertices)
    np.testing.assert_allclose(np.abs(normals).max(axis=1), 1)
    assert len(seams(apart).members) == 6 * 4, "only where four faces of one side meet are they one"


def test_the_kernel_is_its_reference_at_seams():
    mesh = tube(cut=True)
    moved = mesh.vertices + 0.01 * np.random.default_rng(0).normal(size=mesh.vertices.shape)
    out = np.empty_like(moved)
    Surface(mesh, build_lattices(mesh, 0.05)[0]).normals(moved, out)
    np.testing.assert_allclose(out, normals_reference(mesh, moved), atol=1e-12)
