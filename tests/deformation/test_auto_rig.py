"""Skeletons of meshes: joints where a mannequin's own are, whichever way it faces and however its faces are made."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deformation.auto_rig import AutoRig, RigNotFound, RigSettings, rig_mesh, with_joints
from deformation.auto_rig_file import read_joints, write_rig
from deformation.character import LatticeSettings, make_character
from deformation.character_files import read_character
from deformation.mannequin import mannequin
from deformation.mesh import Mesh
from devices.errors import FileError, SettingError
from reconstruction.standard_body import standard_skeleton
from tests.deformation.bodies import box

SHARED = Path(__file__).parents[2] / ".." / "shared" / "meshes"
SCORED = ("upper_leg", "lower_leg", "foot", "upper_arm", "lower_arm", "hand")


@pytest.fixture(scope="module")
def body() -> tuple[Mesh, dict[str, np.ndarray]]:
    skeleton = standard_skeleton()
    mesh, bind = mannequin(skeleton, "low")
    return mesh, {bone: bind[joint, :3, 3] for bone, joint in skeleton.humanoid.items()}


@pytest.fixture(scope="module")
def found(body) -> AutoRig:
    return rig_mesh(body[0])


def errors(found: AutoRig, truth: dict[str, np.ndarray]) -> np.ndarray:
    """Metres between the scored joints and the true ones."""
    bones, places = found.rig.skeleton.humanoid, found.rig.bind[:, :3, 3]
    names = ["neck", *(f"{side}_{bone}" for side in ("left", "right") for bone in SCORED)]
    return np.array([np.linalg.norm(places[bones[name]] - truth[name]) for name in names])


def test_the_mannequins_joints_are_found(body, found: AutoRig) -> None:
    off = errors(found, body[1])
    assert off.mean() < 0.015
    assert off.max() < 0.03
    assert found.template == "human"


@pytest.mark.parametrize("degrees", [90, 180, 217])
def test_it_may_face_anywhere(body, degrees: float) -> None:
    mesh, truth = body
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    turned = rig_mesh(mesh.with_vertices(mesh.vertices @ turn.T))
    off = errors(turned, {name: turn @ place for name, place in truth.items()})
    assert off.mean() < 0.018


def test_size_is_only_a_scale(body, found: AutoRig) -> None:
    small = rig_mesh(body[0].with_vertices(0.1 * body[0].vertices))
    np.testing.assert_allclose(small.rig.bind[:, :3, 3], 0.1 * found.rig.bind[:, :3, 3], atol=1e-3)


def test_quads_cut_in_two_are_joined_again(body) -> None:
    mesh, truth = body
    paired = rig_mesh(Mesh(mesh.vertices, np.empty((0, 4), np.int32), mesh.triangulated))
    assert "paired" in paired.notes[0]
    assert errors(paired, truth).mean() < 0.02


def test_triangles_that_do_not_pair_are_sliced(body) -> None:
    mesh, truth = body
    # Each triangle into three around its middle: no two of them make a quad.
    corners = mesh.triangulated
    middle = np.arange(len(corners)) + len(mesh.vertices)
    split = np.concatenate([np.stack([corners[:, k], corners[:, (k + 1) % 3], middle], axis=1) for k in range(3)])
    vertices = np.concatenate([mesh.vertices, mesh.vertices[corners].mean(axis=1)])
    sliced = rig_mesh(Mesh(vertices, np.empty((0, 4), np.int32), split.astype(np.int32)))
    assert sliced.curves is None
    assert "sliced" in sliced.notes[0]
    assert errors(sliced, truth).mean() < 0.02


def test_the_rig_makes_a_character(body, found: AutoRig) -> None:
    character = make_character(body[0], found.rig.skeleton, found.rig.bind, settings=LatticeSettings(particles=600))
    np.testing.assert_allclose(character.vertex_weights.sum(axis=1), 1, atol=1e-9)
    assert {"hips", "head", "left_hand", "right_foot"} <= set(found.rig.skeleton.humanoid)


def test_a_file_comes_back(found: AutoRig, tmp_path: Path) -> None:
    write_rig(found, tmp_path / "a.rig.json", 0.01, np.array([0, 0.5, 0]))
    places = read_joints(tmp_path / "a.rig.json")
    for name, place in zip(found.rig.skeleton.names, found.rig.bind[:, :3, 3], strict=True):
        np.testing.assert_allclose(places[name] * 0.01 + [0, 0.5, 0], place, atol=1e-6)
    assert [p.name for p in tmp_path.iterdir()] == ["a.rig.json"]


def test_joints_can_be_moved(found: AutoRig, tmp_path: Path) -> None:
    knee = np.array([0.2, 0.5, 0.1])
    moved = with_joints(found, {"left_lower_leg": knee})
    index = moved.rig.skeleton.names.index("left_lower_leg")
    np.testing.assert_allclose(moved.rig.bind[index, :3, 3], knee)
    foot = moved.rig.skeleton.names.index("left_foot")
    np.testing.assert_allclose(moved.rig.bind[foot], found.rig.bind[foot])
    with pytest.raises(SettingError, match="left_lower_leg"):
        with_joints(found, {"left_knie": knee})
    (tmp_path / "broken.json").write_text('{"bones": [{"name": "hips"}]}')
    with pytest.raises(FileError, match=r"broken\.json"):
        read_joints(tmp_path / "broken.json")


def test_what_is_no_character_is_refused() -> None:
    with pytest.raises(RigNotFound, match="found") as refusal:
        rig_mesh(box((0, 0, 0), (1, 1, 1), 6))
    assert refusal.value.tips.shape[1] == 3
    with pytest.raises(SettingError, match="quadruped"):
        RigSettings("spider")


@pytest.mark.skipif(not SHARED.is_dir(), reason="no folder of shared meshes beside the repository")
@pytest.mark.parametrize(("name", "mean_m"), [("makehuman_body.obj", 0.03), ("human-male.glb", 0.035)])
def test_people_of_other_makes(name: str, mean_m: float) -> None:
    file = read_character(SHARED / name)
    assert file.rig is not None
    truth = {bone: file.rig.bind[joint, :3, 3] for bone, joint in file.rig.skeleton.humanoid.items()}
    assert errors(rig_mesh(file.mesh), truth).mean() < mean_m


@pytest.mark.skipif(not SHARED.is_dir(), reason="no folder of shared meshes beside the repository")
@pytest.mark.parametrize("name", ["horse_quad.obj", "fox-cat.glb"])
def test_animals_stand_on_four_legs(name: str) -> None:
    file = read_character(SHARED / name)
    found = rig_mesh(file.mesh)
    assert found.template == "quadruped"
    bones, places = found.rig.skeleton.humanoid, found.rig.bind[:, :3, 3]
    height = float(np.ptp(file.mesh.vertices[:, 1]))
    for limb in ("leg", "arm"):
        end = "foot" if limb == "leg" else "hand"
        for side in ("left", "right"):
            ys = [places[bones[f"{side}_{part}"], 1] for part in (f"upper_{limb}", f"lower_{limb}", end)]
            assert ys == sorted(ys, reverse=True)
            assert ys[-1] < 0.35 * height
    hips, chest, head = (places[bones[name]] for name in ("hips", "upper_chest", "head"))
    forward = (chest - hips) * [1, 0, 1]
    assert (head - chest) @ forward > 0
    left, right = places[bones["left_foot"]], places[bones["right_foot"]]
    assert np.cross([0, 1, 0], forward) @ (left - right) > 0
