from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from deformation.character import (
    Character,
    LatticeSettings,
    make_character,
    mannequin_character,
    with_softness,
)
from deformation.deformer import Deformer, DeformSettings
from deformation.heat_weights import spread
from deformation.materials import joint_softness
from deformation.painting import Painting
from deformation.secondary_motion import SecondarySettings
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


CHANGES = st.fixed_dictionaries(
    {
        "volume": st.booleans(),
        "delta": st.one_of(st.none(), st.floats(0, 0.95)),
        "frequency_hz": st.floats(0.5, 12),
        "damping_ratio": st.floats(0, 2),
        "gravity": st.floats(0, 20),
        "legs": st.floats(0, 3),
        "poke": st.booleans(),
    }
)


@settings(max_examples=15, deadline=None)
@given(st.lists(CHANGES, min_size=4, max_size=4))
def test_no_change_while_running_makes_it_blow_up(character: Character, changes: list[dict]) -> None:
    deformer, plain = Deformer(character), Deformer(character, DeformSettings(secondary=None))
    for number, change in enumerate(changes):
        swing = SecondarySettings(
            change["delta"] or 0.0, change["frequency_hz"], change["damping_ratio"], (0.0, -change["gravity"], 0.0)
        )
        secondary = None if change["delta"] is None else swing
        deformer.settings = DeformSettings(change["volume"], secondary, {"legs": change["legs"]})
        plain.settings = DeformSettings(change["volume"], None)
        if change["poke"]:
            deformer.poke(5.0)
        for step in range(6):
            pose = kneeling(character, 0.3 * number + 0.05 * step)
            away = deformer.deform(pose).vertices - plain.deform(pose).vertices
            assert np.linalg.norm(away, axis=1).max() <= 1.5 * character.lattice.cell_size + 1e-9
    deformer.settings = DeformSettings(secondary=SecondarySettings(damping_ratio=1))
    plain.settings = DeformSettings(secondary=None)
    for _ in range(90):
        shown = deformer.deform(pose).vertices
    np.testing.assert_allclose(shown, plain.deform(pose).vertices, atol=1e-3)


def test_flesh_switched_off_and_on_again_starts_at_rest(character: Character) -> None:
    deformer, pose = Deformer(with_softness(character, np.ones(len(character.mesh.vertices)))), kneeling(character, 1)
    deformer.deform(pose)
    deformer.poke()
    deformer.deform(pose)
    swing = deformer.settings
    deformer.settings = replace(swing, secondary=None)
    still = deformer.deform(pose).vertices.copy()
    deformer.settings = swing
    np.testing.assert_allclose(deformer.deform(pose).vertices, still, atol=1e-12)


def test_a_region_can_be_made_rigid_alone() -> None:
    character = mannequin_character(standard_skeleton(), "low", settings=LatticeSettings(particles=800))
    deformer, plain = Deformer(character, DeformSettings(softness={"belly": 0.0})), Deformer(character)
    for each in (deformer, plain):
        each.deform(character.bind)
        each.poke()
        for _ in range(3):
            each.deform(character.bind)
    moved, usual = (np.linalg.norm(d._vertices - character.mesh.vertices, axis=1) for d in (deformer, plain))
    belly = character.vertex_joints[:, 0] == character.skeleton.humanoid["spine"]
    core = belly & (character.vertex_weights[:, 0] > 0.6)
    assert usual[core].max() > 2e-3
    assert moved[core].max() < 0.7 * usual[core].max()
    assert moved.max() > 2e-3, "the others still swing"


@pytest.mark.parametrize(
    ("softness", "message"), [({"tail": 1.0}, "material region 'tail'"), ({"arms": 9.0}, "0 to 3")]
)
def test_a_region_that_is_none_and_a_factor_out_of_range_are_named(softness: dict[str, float], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        DeformSettings(softness=softness)
