"""Several poses of one mesh: each joint comes from the pose that bends it most, in the first pose's place."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deformation.auto_rig import AutoRig, RigNotFound, RigSettings, rig_mesh
from deformation.auto_rig_poses import carried, rig_poses
from deformation.character import Character, LatticeSettings, mannequin_character
from deformation.deformer import Deformer, DeformSettings
from deformation.example_files import posed
from deformation.mesh import Mesh
from devices.errors import SettingError
from reconstruction.standard_body import standard_skeleton
from tests.deformation.bodies import box


@pytest.fixture(scope="module")
def character() -> Character:
    return mannequin_character(standard_skeleton(), "low", settings=LatticeSettings(particles=1200))


def in_pose(character: Character, **turns: list[float]) -> Mesh:
    """The character with bones turned by rotation vectors in degrees."""
    bones = character.skeleton.humanoid
    joints = posed(character, {bones[bone]: np.radians(turn) for bone, turn in turns.items()})
    vertices = Deformer(character, DeformSettings(secondary=None)).deform(joints).vertices
    return character.mesh.with_vertices(vertices - [0, vertices[:, 1].min(), 0])


def test_bent_joints_come_from_where_they_bend(character: Character) -> None:
    elbow = in_pose(character, left_lower_arm=[0, -80, 0])
    knee = in_pose(character, right_upper_leg=[-50, 0, 0], right_lower_leg=[70, 0, 0])
    single, merged = rig_mesh(character.mesh), rig_poses([character.mesh, elbow, knee])
    told = " ".join(merged.notes)
    assert "left_lower_arm from pose 2, bent by" in told
    assert "right_lower_leg from pose 3, bent by" in told
    for bone, moved in (("left_lower_arm", True), ("right_lower_leg", True), ("right_lower_arm", False)):
        index = merged.rig.skeleton.names.index(bone)
        truth = character.bind[character.skeleton.humanoid[bone], :3, 3]
        assert np.linalg.norm(merged.rig.bind[index, :3, 3] - truth) < 0.03
        assert np.array_equal(merged.rig.bind[index], single.rig.bind[index]) != moved


def test_one_pose_is_enough_and_bad_ones_are_left_out(character: Character, monkeypatch: pytest.MonkeyPatch) -> None:
    curled = in_pose(character, left_lower_arm=[0, -80, 0])

    def rig_but_curled(mesh: Mesh, settings: RigSettings | None = None) -> AutoRig:
        if mesh is curled:
            raise RigNotFound("curled up", np.empty((0, 3)))
        return rig_mesh(mesh, settings)

    monkeypatch.setattr("deformation.auto_rig_poses.rig_mesh", rig_but_curled)
    alone, both = rig_poses([character.mesh]), rig_poses([character.mesh, curled])
    np.testing.assert_array_equal(alone.rig.bind, both.rig.bind)
    assert both.notes == (*alone.notes, "pose 2 is left out: curled up")
    with pytest.raises(RigNotFound):
        rig_poses([curled, character.mesh])
    with pytest.raises(SettingError, match="same mesh"):
        rig_poses([character.mesh, box((0, 0, 0), (1, 1, 1))])
    with pytest.raises(SettingError, match="same mesh"):
        rig_poses([])


def test_places_are_carried_by_what_is_around_them() -> None:
    mesh = box((0, 0, 0), (1, 1, 1), 4)
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    place = np.array([0.4, 0.55, 0.5])
    to = mesh.vertices @ turn.T + [1, 2, 3]
    np.testing.assert_allclose(carried(place, mesh.vertices, to), turn @ place + [1, 2, 3], atol=1e-9)
