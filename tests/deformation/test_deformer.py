from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deformation.character import Character, make_character, with_softness
from deformation.deformer import Deformer, DeformSettings
from deformation.heat_weights import spread
from deformation.materials import joint_softness
from deformation.painting import Painting
from deformation.surface import normals_reference
from devices.errors import SettingError
from reconstruction.standard_body import standard_skeleton
from tests.deformation.bodies import two_legs


@pytest.fixture(scope="module")
def character() -> Character:
    return make_character(*two_legs())


def kneeling(character: Character, bend: float) -> np.ndarray:
    transforms = character.bind.copy()
    turn = Rotation.from_rotvec([bend, 0, 0]).as_matrix()
    for joint, knee in ((3, 3), (4, 3), (6, 6), (7, 6)):
        at = character.bind[knee, :3, 3]
        transforms[joint, :3, :3] = turn
        transforms[joint, :3, 3] = turn @ (character.bind[joint, :3, 3] - at) + at
    return transforms


def test_the_bind_pose_is_the_mesh(character: Character) -> None:
    deformer = Deformer(character)
    for _ in range(5):
        shown = deformer.deform(character.bind)
        np.testing.assert_allclose(shown.vertices, character.mesh.vertices, atol=1e-12)
    np.testing.assert_allclose(shown.normals, normals_reference(character.mesh, character.mesh.vertices), atol=1e-9)


def test_rigid_motion_carries_the_mesh_along(character: Character) -> None:
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = Rotation.from_rotvec([0.4, -0.8, 0.1]).as_matrix(), [1, 2, 3]
    pose = kneeling(character, 1.0)
    deformer = Deformer(character, DeformSettings(secondary=None))
    here = deformer.deform(pose).vertices.copy()
    there = deformer.deform(move @ pose).vertices
    np.testing.assert_allclose(there, here @ move[:3, :3].T + move[:3, 3], atol=1e-9)


def test_flesh_settles_on_the_primary_deformation(character: Character) -> None:
    soft = with_softness(character, np.ones(len(character.mesh.vertices)))
    moving, plain = Deformer(soft), Deformer(soft, DeformSettings(secondary=None))
    swing = []
    for step in range(200):
        pose = kneeling(character, min(step / 30, 1.2))
        shown = moving.deform(pose)
        swing.append(np.linalg.norm(shown.vertices - plain.deform(pose).vertices, axis=1).max())
    assert max(swing) > 1e-3
    np.testing.assert_allclose(shown.vertices, plain.deform(pose).vertices, atol=1e-5)


def test_switches_work_while_running(character: Character) -> None:
    deformer, pose = Deformer(character), kneeling(character, 2.0)
    kept = deformer.deform(pose).vertices.copy()
    deformer.settings = replace(deformer.settings, volume=False)
    deformer.reset()
    assert np.abs(deformer.deform(pose).vertices - kept).max() > 1e-4
    deformer.settings = DeformSettings(secondary=None)
    np.testing.assert_allclose(deformer.deform(pose).vertices, kept, atol=1e-9)


def test_a_push_moves_what_is_near(character: Character) -> None:
    soft = with_softness(character, np.ones(len(character.mesh.vertices)))
    deformer = Deformer(soft)
    deformer.deform(soft.bind)
    deformer.push(np.array([0, 0, 1.0]), np.array([0, 0.2, 0.07]), 0.1)
    shown = [deformer.deform(soft.bind).vertices.copy() for _ in range(4)][-1]
    moved = np.linalg.norm(shown - soft.mesh.vertices, axis=1)
    assert moved[soft.mesh.vertices[:, 1] > 0.15].max() > 1e-3
    assert moved[soft.mesh.vertices[:, 1] < -0.3].max() < 1e-4


def test_painted_weights_are_used(character: Character) -> None:
    painted = np.zeros((len(character.mesh.vertices), len(character.skeleton)))
    low = character.mesh.vertices[:, 1] < -0.2
    painted[low, 3], painted[~low, 0] = 1, 1
    other = make_character(character.mesh, character.skeleton, character.bind, painting=Painting(painted))
    np.testing.assert_array_equal(other.vertex_joints[:, 0], np.where(low, 3, 0))
    top = other.lattice.particles[:, 1] > -0.05
    np.testing.assert_array_equal(other.binding.joints[top, 0], 0)


def test_painted_values_spread_inward_harmonically(character: Character) -> None:
    lattice = character.lattice
    np.testing.assert_allclose(spread(lattice, np.full((len(character.mesh.vertices), 1), 0.3)), 0.3)
    height = spread(lattice, character.mesh.vertices[:, 1:2])[:, 0]
    assert np.abs(height - lattice.particles[:, 1]).max() < 2 * lattice.cell_size


def test_softness_out_of_range_is_named(character: Character) -> None:
    with pytest.raises(SettingError, match="softness"):
        with_softness(character, np.full(len(character.mesh.vertices), 1.5))


def test_a_belly_is_softer_than_a_shin() -> None:
    skeleton = standard_skeleton()
    soft = dict(zip(skeleton.names, joint_softness(skeleton), strict=True))
    assert soft["Spine"] > soft["LeftLeg"] > soft["LeftFoot"] == soft["LeftToeBase_end"] == 0
