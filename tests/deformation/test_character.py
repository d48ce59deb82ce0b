import numpy as np
import pytest

from deformation.character import LatticeSettings, coarser, make_character
from deformation.lattice import build_lattices
from deformation.mesh import Mesh
from deformation.surface import Surface, interpolate_reference, normals_reference
from devices.errors import SettingError
from tests.deformation.bodies import box, chain, two_legs


def test_weights_are_at_most_four_sorted_and_sum_to_one() -> None:
    mesh, skeleton, bind = two_legs()
    character = make_character(mesh, skeleton, bind)
    for joints, weights in (
        (character.vertex_joints, character.vertex_weights),
        (character.binding.joints, character.binding.weights),
    ):
        assert joints.shape == weights.shape
        assert weights.shape[1] == 4
        np.testing.assert_allclose(weights.sum(axis=1), 1)
        assert (np.diff(weights, axis=1) <= 0).all()
        assert not np.isin(joints[weights > 0], np.flatnonzero(skeleton.is_end)).any()


def test_what_a_character_holds_is_read_only() -> None:
    character = make_character(*two_legs())
    for array in (character.bind, character.vertex_weights, character.lattice.particles, character.binding.centres):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_constant_fields_stay_constant_on_a_coarser_lattice() -> None:
    coarse, fine, parents = build_lattices(two_legs()[0], 0.05)
    weights = np.tile([0.25, 0.75], (len(fine.particles), 1))
    np.testing.assert_allclose(
        coarser(weights, fine, coarse, parents), np.tile([0.25, 0.75], (len(coarse.particles), 1))
    )


def test_cell_size_and_particle_count_exclude_each_other() -> None:
    skeleton, bind = chain((0, 0, 0), (0, 1, 0))
    with pytest.raises(SettingError, match="use one of them"):
        make_character(box((-0.1, 0, -0.1), (0.1, 1, 0.1)), skeleton, bind, settings=LatticeSettings(0.1, 500))


def test_surface_kernels_are_their_references() -> None:
    quads = two_legs()[0]
    mesh = Mesh(quads.vertices, quads.quads[::2], Mesh(quads.vertices, quads.quads[1::2], quads.triangles).triangulated)
    lattice, _, _ = build_lattices(mesh, 0.06)
    particles = lattice.particles + 0.01 * np.random.default_rng(1).normal(size=lattice.particles.shape)
    surface = Surface(mesh, lattice)
    vertices, normals = np.empty_like(mesh.vertices), np.empty_like(mesh.vertices)
    surface.vertices(particles, vertices)
    np.testing.assert_allclose(vertices, interpolate_reference(lattice, particles), atol=1e-13)
    surface.normals(vertices, normals)
    np.testing.assert_allclose(normals, normals_reference(mesh, vertices), atol=1e-12)
