import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deformation.character import Character, LatticeSettings, make_character
from deformation.skinning import blend, joint_motion, linear_blend
from deformation.volume import (
    lattice_octants,
    octant_volumes,
    outward_field,
    part_volumes,
    preserve,
    preserve_reference,
)
from tests.deformation.bodies import box, chain, two_legs


@pytest.fixture(scope="module")
def limb() -> Character:
    skeleton, bind = chain((0, 0, 0), (0.4, 0, 0), (0.8, 0, 0), (1.0, 0, 0))
    return make_character(box((0, -0.1, -0.1), (1, 0.1, 0.1), 8), skeleton, bind, settings=LatticeSettings(0.05))


def posed(character: Character, *vectors: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Motion, skinned particles and their rotations with each joint turned, children along with parents."""
    skeleton, transforms = character.skeleton, character.bind.copy()
    turns = Rotation.from_rotvec([*vectors, *[(0, 0, 0)] * (len(skeleton) - len(vectors))]).as_matrix()
    for joint, parent in enumerate(skeleton.parents):
        above = transforms[parent] if parent >= 0 else np.eye(4)
        local = np.eye(4)
        local[:3, :3], local[:3, 3] = turns[joint], skeleton.offsets[joint]
        transforms[joint] = above @ local
    motion = joint_motion(transforms, character.bind_inverse)
    particles, rotations = (
        np.empty_like(character.lattice.particles),
        np.empty((len(character.lattice.particles), 3, 3)),
    )
    blend(motion, character.binding, character.lattice.particles, particles, rotations)
    return motion, particles, rotations


HARD = [((0, 0, 0), (0, 0, 1.57)), ((0, 0, 0), (0, 1.57, 0), (0, 0, -1.2)), ((0.3, 0, 0), (2.6, 0, 0))]


def test_octants_fill_the_cells() -> None:
    character = make_character(*two_legs())
    lattice = character.lattice
    sizes = octant_volumes(lattice.particles, lattice_octants(lattice))
    np.testing.assert_allclose(sizes, lattice.cell_size**3 / 8)
    np.testing.assert_allclose(character.parts.volumes.sum(), len(lattice.cells) * lattice.cell_size**3)


def test_what_turns_inside_out_counts_against_the_volume() -> None:
    lattice = make_character(*two_legs()).lattice
    assert octant_volumes(lattice.particles * [-1, 1, 1], lattice_octants(lattice)).max() < 0


def test_parts_lie_around_their_joints_parents_first(limb: Character) -> None:
    parts = limb.parts
    assert list(parts.joints) == sorted(parts.joints)
    centres = [limb.lattice.particles[parts.part_of == k].mean(axis=0) for k in range(len(parts.joints))]
    nearest = [np.linalg.norm(limb.bind[parts.joints, :3, 3] - centre, axis=1).argmin() for centre in centres]
    assert nearest == list(range(len(parts.joints)))
    np.testing.assert_allclose(np.bincount(parts.members, parts.shares), 1)


def test_the_field_points_out_and_fades_inward(limb: Character) -> None:
    field, particles = outward_field(limb.lattice), limb.lattice.particles
    size = np.linalg.norm(field, axis=1)
    assert size.max() <= 1 + 1e-12
    ridge = (np.abs(particles[:, 1]) > 0.08) & (particles[:, 0] > 0.2) & (particles[:, 0] < 0.8)
    assert (field[ridge, 1] * particles[ridge, 1] > 0).all()
    core = (np.linalg.norm(particles[:, 1:], axis=1) < 0.05) & (np.abs(particles[:, 0] - 0.5) < 0.3)
    assert size[core].max() < 0.75


@pytest.mark.parametrize("pose", HARD)
def test_every_part_gets_its_volume_back_where_linear_blending_loses_it(limb: Character, pose: tuple) -> None:
    motion, particles, rotations = posed(limb, *pose)
    linear = linear_blend(motion, limb.binding, limb.lattice.particles)
    preserve(particles, rotations, limb.parts, limb.lattice.cell_size)
    kept = part_volumes(particles, limb.parts) / limb.parts.volumes - 1
    lost = part_volumes(linear, limb.parts) / limb.parts.volumes - 1
    assert np.abs(kept).max() < 0.01
    assert np.abs(lost).max() > 0.05
    assert abs(part_volumes(particles, limb.parts).sum() / limb.parts.volumes.sum() - 1) < 0.002


@pytest.mark.parametrize("pose", HARD)
def test_the_kernel_is_its_reference(limb: Character, pose: tuple) -> None:
    _, particles, rotations = posed(limb, *pose)
    expected = preserve_reference(particles, rotations, limb.parts, limb.lattice.cell_size)
    preserve(particles, rotations, limb.parts, limb.lattice.cell_size)
    np.testing.assert_allclose(particles, expected, atol=1e-12)


def test_a_pose_that_loses_nothing_is_left_alone(limb: Character) -> None:
    _, particles, rotations = posed(limb, (0.5, 0.7, -0.3))
    before = particles.copy()
    preserve(particles, rotations, limb.parts, limb.lattice.cell_size)
    np.testing.assert_array_equal(particles, before)
