"""`sixpoint rig` and `sixpoint inbetween` from file to file."""

import json
from pathlib import Path

import numpy as np
import pytest

from capture.commands.rig import inbetween, rig
from capture.viewing import Layers
from deformation.character_files import bound_character, read_character
from deformation.inbetween_files import write_shapes
from deformation.mannequin import mannequin
from deformation.mesh import Mesh
from deformation.mesh_files import read_mesh
from devices.errors import FileError, SixpointError
from reconstruction.standard_body import standard_skeleton
from tests.deformation.bodies import box


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    mesh, _ = mannequin(standard_skeleton(), "low")
    place = tmp_path_factory.mktemp("bodies")
    write_shapes(mesh, [100 * mesh.vertices, 100 * mesh.vertices * [1.1, 1, 1]], place / "poses")
    return place


def test_a_rigged_mesh_is_a_character(folder: Path) -> None:
    body = folder / "poses" / "0000.obj"
    rig([body], folder / "poses" / "0000.rig.json")
    assert (folder / "poses" / "0000.rig.png").stat().st_size > 10_000
    content = json.loads((folder / "poses" / "0000.rig.json").read_text())
    assert content["format"] == "sixpoint-rig 1"
    character = bound_character(read_character(body))
    assert {"hips", "head", "left_hand", "right_foot"} <= set(character.skeleton.humanoid)
    knee = character.bind[character.skeleton.humanoid["left_lower_leg"], :3, 3]
    assert knee[0] > 0
    assert 0.4 < knee[1] < 0.6


def test_a_joint_moved_in_a_file_moves(folder: Path) -> None:
    body, own = folder / "poses" / "0000.obj", folder / "own.json"
    own.write_text(json.dumps({"bones": [{"name": "left_lower_leg", "head": [15.0, 50.0, 2.0]}]}))
    rig([body], folder / "moved.json", joints=own, picture=False)
    heads = {bone["name"]: bone["head"] for bone in json.loads((folder / "moved.json").read_text())["bones"]}
    assert heads["left_lower_leg"] == pytest.approx([15.0, 50.0, 2.0], abs=1e-4)
    assert not (folder / "moved.png").exists()


def test_more_poses_are_of_the_same_mesh(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses = [folder / "poses" / "0000.obj", folder / "poses" / "0001.obj"]
    rig(poses, tmp_path / "both.json", picture=False)
    assert "human of" in capsys.readouterr().out
    other = box((0, 0, 0), (1, 1, 1))
    write_shapes(other, [other.vertices], tmp_path / "box")
    with pytest.raises(FileError, match="use poses of the same mesh"):
        rig([poses[0], tmp_path / "box" / "0000.obj"], tmp_path / "none.json")


def test_a_window_needs_a_display(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(SixpointError, match="no display"):
        rig([folder / "poses" / "0000.obj"], tmp_path / "rig.json", show=True)
    assert not list(tmp_path.iterdir())


def test_the_window_shows_what_was_found(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = []
    monkeypatch.setattr("capture.viewer.has_display", lambda: True)
    monkeypatch.setattr("capture.viewer.show", lambda view, **_: shown.append(view))
    rig([folder / "poses" / "0000.obj"], tmp_path / "rig.json", show=True, picture=False)
    scene = shown[0].scene(0.0, Layers(skeleton=True, curves=True))
    assert len(scene.surfaces) == 1
    assert len(scene.lines) > 5
    assert scene.status
    bare = shown[0].scene(0.0, Layers(skin=False, statistics=False))
    assert (bare.surfaces, bare.lines, bare.spheres, bare.status) == ((), (), (), ())


def test_what_cannot_be_rigged_is_shown(tmp_path: Path) -> None:
    write_shapes(box((0, 0, 0), (1, 1, 1)), [box((0, 0, 0), (1, 1, 1)).vertices], tmp_path / "box")
    with pytest.raises(FileError, match=r"rig\.png shows what was found"):
        rig([tmp_path / "box" / "0000.obj"], tmp_path / "rig.json")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["box", "rig.png"]


def test_shapes_between_two_files(folder: Path, tmp_path: Path) -> None:
    poses = [folder / "poses" / "0000.obj", folder / "poses" / "0001.obj"]
    inbetween(poses, 2, tmp_path / "shapes")
    shapes = [read_mesh(path) for path in sorted((tmp_path / "shapes").iterdir())]
    assert len(shapes) == 4
    for shape, pose in ((shapes[0], poses[0]), (shapes[-1], poses[1])):
        np.testing.assert_allclose(shape.vertices, read_mesh(pose).vertices, atol=1e-4)
        assert np.array_equal(shape.quads, shapes[0].quads)
    inbetween(poses, 1, tmp_path / "shapes.npz")
    with np.load(tmp_path / "shapes.npz") as archive:
        assert archive["vertices"].shape == (3, len(shapes[0].vertices), 3)


def test_poses_of_different_meshes_are_refused(folder: Path, tmp_path: Path) -> None:
    other = box((0, 0, 0), (1, 1, 1))
    write_shapes(other, [other.vertices], tmp_path / "box")
    with pytest.raises(FileError, match="use poses of the same mesh"):
        inbetween([folder / "poses" / "0000.obj", tmp_path / "box" / "0000.obj"], 1, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_failing_write_leaves_nothing(tmp_path: Path) -> None:
    mesh: Mesh = box((0, 0, 0), (1, 1, 1))

    def shapes():
        yield mesh.vertices
        raise OSError("disk full")

    for name in ("folder", "file.npz"):
        with pytest.raises(OSError, match="disk full"):
            write_shapes(mesh, shapes(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []
