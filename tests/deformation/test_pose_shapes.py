"""Example shapes: they come in with the joint's angle, are met exactly at rest, and turn with the skin."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from deformation.character import Character, LatticeSettings, make_character
from deformation.deformer import Deformer, DeformSettings
from deformation.mesh import Mesh
from deformation.pose_shapes import ExampleShape, PoseDrivenShapes, angle_about, blended_turns, relative_turn
from devices.errors import SettingError
from tests.deformation.bodies import chain
from tests.deformation.test_isocurves import cylinder

PARENTS = np.array([-1, 0, 1], np.int32)


def limb() -> tuple[Mesh, np.ndarray, np.ndarray]:
    """A tube along X whose vertices go over from joint 0 to joint 1."""
    mesh = cylinder(8, 9)
    share = np.clip(mesh.vertices[:, 0] / np.ptp(mesh.vertices[:, 0]), 0, 1)
    joints = np.tile(np.array([0, 1], np.int32), (len(share), 1))
    return mesh, joints, np.stack([1 - share, share], axis=1)


def motion(*turns: Rotation) -> np.ndarray:
    """(J, 3, 4) of joints that stand at the origin, each turned against the one before."""
    result, above = np.zeros((len(turns), 3, 4)), np.eye(3)
    for joint, turn in enumerate(turns):
        above = result[joint, :, :3] = above @ turn.as_matrix()
    return result


def still() -> Rotation:
    return Rotation.identity()


def test_shapes_come_in_as_a_joint_bends() -> None:
    mesh, joints, weights = limb()
    bulge = np.tile([0.0, 0.1, 0.0], (len(mesh.vertices), 1))
    axis = np.array([0.0, 0.0, 1.0])
    examples = [ExampleShape(1, 0.5 * axis, bulge), ExampleShape(1, axis, 3 * bulge)]
    shapes = PoseDrivenShapes(mesh, PARENTS, joints, weights, examples)
    for angle, factor in ((-0.5, 0), (0.0, 0), (0.25, 0.5), (0.5, 1), (0.75, 2), (1.0, 3), (2.0, 3)):
        at = motion(still(), Rotation.from_rotvec(angle * axis), still())
        shapes.reset()
        shown = np.zeros_like(bulge)
        shapes.add(shown, at, 1 / 60)
        turned = np.einsum("nij,nj->ni", blended_turns(at, joints, weights), factor * bulge)
        np.testing.assert_allclose(shown, turned, atol=1e-12)


def test_a_shape_lags_and_settles() -> None:
    mesh, joints, weights = limb()
    bulge = np.zeros_like(mesh.vertices)
    bulge[24:48] = mesh.vertices[24:48] * [0.0, 0.5, 0.0]
    shapes = PoseDrivenShapes(mesh, PARENTS, joints, weights, [ExampleShape(1, np.array([0, 0, 1.0]), bulge)])
    straight, bent = (motion(still(), Rotation.from_rotvec([0, 0, a]), still()) for a in (0.0, 1.0))
    target = np.einsum("nij,nj->ni", blended_turns(bent, joints, weights), bulge)
    shapes.add(np.zeros_like(bulge), straight, 1 / 60)
    off = []
    for frame in range(180):
        shown = np.zeros_like(bulge)
        shapes.add(shown, bent, 1 / 60 if frame % 2 else 1 / 45)
        off.append(np.abs(shown - target).max())
    assert off[0] > 1e-3
    assert off[-1] < 1e-5
    shown = np.zeros_like(bulge)
    shapes.add(shown, straight, 0.5)
    np.testing.assert_array_equal(shown, 0)


@settings(max_examples=60, deadline=None)
@given(st.floats(-3, 3), st.integers(0, 2**31))
def test_a_turn_about_an_axis_is_told_from_any_other(angle: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    axis = random.normal(size=3)
    axis /= np.linalg.norm(axis)
    across = np.cross(axis, random.normal(size=3))
    across /= np.linalg.norm(across)
    twist, swing = Rotation.from_rotvec(angle * axis), Rotation.from_rotvec(random.uniform(-1.5, 1.5) * across)
    assert angle_about((swing * twist).as_matrix(), axis) == pytest.approx(angle, abs=1e-7)
    above = Rotation.from_rotvec(random.normal(size=3))
    both = motion(above, twist, still())
    np.testing.assert_allclose(relative_turn(both, PARENTS, 1), twist.as_matrix(), atol=1e-12)


def test_joints_that_turn_another_way_bring_nothing() -> None:
    mesh, joints, weights = limb()
    bulge = np.full_like(mesh.vertices, 0.1)
    shapes = PoseDrivenShapes(mesh, PARENTS, joints, weights, [ExampleShape(1, np.array([0, 0, 1.0]), bulge)])
    for turn in ([0, 0, -1.0], [1.0, 0, 0], [0, 1.0, 0]):
        assert not shapes.weights(motion(still(), Rotation.from_rotvec(turn), still()))
    assert not shapes.weights(motion(Rotation.from_rotvec([0, 0, 1.0]), still(), still()))


def test_wrong_examples_are_named() -> None:
    mesh, joints, weights = limb()
    shape = np.full_like(mesh.vertices, 0.1)
    for turns, words in ((([0, 0, 1e-4],), "one or more"), (([0, 0, 1.0], [0, 0, 1.0]), "once")):
        examples = [ExampleShape(1, np.array(turn, float), shape) for turn in turns]
        with pytest.raises(SettingError, match=words):
            PoseDrivenShapes(mesh, PARENTS, joints, weights, examples)


@pytest.fixture(scope="module")
def character() -> Character:
    mesh = cylinder(12, 20)
    long = float(np.ptp(mesh.vertices[:, 0]))
    skeleton, bind = chain((0, 0, 0), (long / 2, 0, 0), (long, 0, 0))
    return make_character(mesh, skeleton, bind, settings=LatticeSettings(particles=300))


def test_a_character_wears_its_examples(character: Character) -> None:
    turn = np.array([0, 0, 1.2])
    middle = character.mesh.vertices.mean(axis=0)
    offsets = 0.02 * np.exp(-(((character.mesh.vertices - middle) / 0.1) ** 2).sum(axis=1))[:, None] * [0.0, 1.0, 0.0]
    wearing = replace(character, examples=(ExampleShape(1, turn, offsets),))
    bent = character.bind.copy()
    bent[1, :3, :3] = bent[2, :3, :3] = Rotation.from_rotvec(turn).as_matrix()
    bent[2, :3, 3] = bent[1, :3, 3] + bent[1, :3, :3] @ (character.bind[2, :3, 3] - character.bind[1, :3, 3])
    plain, worn = (Deformer(c, DeformSettings(secondary=None)) for c in (character, wearing))
    np.testing.assert_array_equal(plain.deform(character.bind).vertices, worn.deform(character.bind).vertices)
    worn.reset()
    before, after = plain.deform(bent), worn.deform(bent)
    moved = after.vertices - before.vertices
    turns = blended_turns((bent @ character.bind_inverse)[:, :3], character.vertex_joints, character.vertex_weights)
    np.testing.assert_allclose(moved, np.einsum("nij,nj->ni", turns, offsets), atol=1e-5)
    assert np.abs(after.normals - before.normals).max() > 0.01
