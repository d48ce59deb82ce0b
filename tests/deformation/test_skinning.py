import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from deformation.character import Character, LatticeSettings, make_character
from deformation.polar import polar, polar_reference
from deformation.skinning import blend, blend_reference, joint_motion, linear_blend
from tests.deformation.bodies import at, box, chain


def arm() -> Character:
    skeleton, bind = chain((0, 0, 0), (0.5, 0, 0), (1, 0, 0))
    return make_character(box((0, -0.1, -0.1), (1, 0.1, 0.1), 8), skeleton, bind, settings=LatticeSettings(0.06))


ARM = arm()


def turned(character: Character, rotations: Rotation) -> np.ndarray:
    """T_world_joint with each joint turned about where it stands."""
    transforms = character.bind.copy()
    transforms[:, :3, :3] = rotations.as_matrix()
    return transforms


def blended(character: Character, transforms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    motion = joint_motion(transforms, character.bind_inverse)
    positions = np.empty_like(character.lattice.particles)
    rotations = np.empty((len(positions), 3, 3))
    blend(motion, character.binding, character.lattice.particles, positions, rotations)
    return positions, rotations


rotation_vectors = st.lists(st.floats(-2.9, 2.9), min_size=9, max_size=9).map(lambda v: np.reshape(v, (3, 3)))


@settings(deadline=None)
@given(rotation_vectors)
def test_the_kernel_is_its_reference(vectors: np.ndarray) -> None:
    transforms = turned(ARM, Rotation.from_rotvec(vectors))
    motion = joint_motion(transforms, ARM.bind_inverse)
    positions, rotations = blended(ARM, transforms)
    expected, turns = blend_reference(motion, ARM.binding, ARM.lattice.particles)
    np.testing.assert_allclose(positions, expected, atol=1e-7)
    np.testing.assert_allclose(rotations, turns, atol=1e-6)


@given(st.lists(st.floats(-2, 2), min_size=9, max_size=9))
def test_polar_is_the_nearest_rotation(numbers: list[float]) -> None:
    matrix = np.reshape(numbers, (3, 3))
    size = np.linalg.svd(matrix)[1]
    found, numbers_out = polar(tuple(map(float, numbers)))
    if np.linalg.det(matrix) <= 0:
        assert not found
    elif size[2] > 1e-3 * size[0] and size[2] > 1e-6:
        rotation = np.reshape(numbers_out, (3, 3))
        np.testing.assert_allclose(rotation, polar_reference(matrix[None], np.eye(3)[None])[0], atol=1e-9)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)


def test_the_rest_pose_is_reproduced_exactly() -> None:
    positions, rotations = blended(ARM, ARM.bind)
    np.testing.assert_allclose(positions, ARM.lattice.particles, atol=1e-15)
    np.testing.assert_array_equal(rotations, np.broadcast_to(np.eye(3), rotations.shape))


@settings(deadline=None)
@given(rotation_vectors, st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_skinning_commutes_with_rigid_motion(vectors: np.ndarray, rigid: list[float]) -> None:
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = Rotation.from_rotvec(rigid[:3]).as_matrix(), rigid[3:]
    transforms = turned(ARM, Rotation.from_rotvec(0.5 * vectors))
    positions, rotations = blended(ARM, transforms)
    moved, turned_too = blended(ARM, move @ transforms)
    np.testing.assert_allclose(moved, positions @ move[:3, :3].T + move[:3, 3], atol=1e-7)
    np.testing.assert_allclose(turned_too, move[:3, :3] @ rotations, atol=1e-6)


def test_a_twisted_limb_keeps_its_girth_where_linear_blending_loses_it() -> None:
    transforms = turned(ARM, Rotation.from_rotvec([[0, 0, 0], [2.6, 0, 0], [2.6, 0, 0]]))
    rest = ARM.lattice.particles
    positions, _ = blended(ARM, transforms)
    linear = linear_blend(joint_motion(transforms, ARM.bind_inverse), ARM.binding, rest)
    girth = np.linalg.norm(rest[:, 1:], axis=1)
    outer = girth > 0.05
    assert (np.linalg.norm(positions[:, 1:], axis=1)[outer] / girth[outer]).min() > 0.99
    assert (np.linalg.norm(linear[:, 1:], axis=1)[outer] / girth[outer]).min() < 0.5


def test_particles_of_one_bone_move_with_it_rigidly() -> None:
    transforms = at(ARM.bind[:, :3, 3] + [0.3, 0.2, 0.1])
    transforms[:, :3, :3] = Rotation.from_rotvec([[0.1, 0.2, 0.3], [1, 0, 0], [1, 0, 0]]).as_matrix()
    positions, _ = blended(ARM, transforms)
    own = ARM.binding.weights[:, 0] == 1
    joint = ARM.binding.joints[own, 0]
    local = ARM.lattice.particles[own] - ARM.bind[joint, :3, 3]
    expected = np.einsum("nij,nj->ni", transforms[joint, :3, :3], local) + transforms[joint, :3, 3]
    np.testing.assert_allclose(positions[own], expected, atol=1e-12)
