"""Characters from files: what a GLB says is what comes in, and broken ones are told why."""

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from deformation.character_files import bound_character, read_character
from deformation.mesh import is_closed, volume
from deformation.mesh_files import read_mesh
from deformation.mesh_files.glb import read_glb
from devices.errors import FileError

_MESHES = Path(__file__).parents[2] / ".." / "shared" / "meshes"

_BONES: dict[str, tuple[str | None, tuple[float, float, float]]] = {
    "hips": (None, (0, 1.0, 0)),
    "spine": ("hips", (0, 0.2, 0)),
    "head": ("spine", (0, 0.4, 0)),
    "leftUpperArm": ("spine", (0.2, 0.3, 0)),
    "leftLowerArm": ("leftUpperArm", (0.3, 0, 0)),
    "leftHand": ("leftLowerArm", (0.25, 0, 0)),
    "rightUpperArm": ("spine", (-0.2, 0.3, 0)),
    "rightLowerArm": ("rightUpperArm", (-0.3, 0, 0)),
    "rightHand": ("rightLowerArm", (-0.25, 0, 0)),
    "leftUpperLeg": ("hips", (0.1, -0.05, 0)),
    "leftLowerLeg": ("leftUpperLeg", (0, -0.45, 0)),
    "leftFoot": ("leftLowerLeg", (0, -0.42, 0)),
    "rightUpperLeg": ("hips", (-0.1, -0.05, 0)),
    "rightLowerLeg": ("rightUpperLeg", (0, -0.45, 0)),
    "rightFoot": ("rightLowerLeg", (0, -0.42, 0)),
}
_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
_BOX = _QUADS[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


class Figure:
    """A box of a person as a glTF document: made right, then changed by a test. scale: of a node above all joints."""

    def __init__(self, scale: float = 1.0, turned: bool = False) -> None:
        self.data = bytearray()
        self.document: dict[str, Any] = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": []}
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
        self.vertices = (corners - [0.5, 0, 0.5]) * [0.4, 1.7, 0.3]
        names = [f"bone {n}" for n in range(len(_BONES))]
        order = list(_BONES)
        nodes: list[dict[str, Any]] = [
            {"name": name, "translation": [x / scale for x in _BONES[bone][1]]}
            for name, bone in zip(names, order, strict=True)
        ]
        for number, bone in enumerate(order):
            children = [n for n, other in enumerate(order) if _BONES[other][0] == bone]
            if children:
                nodes[number]["children"] = children
        turn = [0, 1, 0, 0] if turned else [0, 0, 0, 1]
        nodes.append({"name": "body", "mesh": 0, "skin": 0})
        nodes.append({"name": "armature", "scale": [scale] * 3, "rotation": turn, "children": [0]})
        self.document |= {"nodes": nodes, "scenes": [{"nodes": [len(order), len(order) + 1]}], "scene": 0}
        world = {}
        for bone, (parent, offset) in _BONES.items():
            world[bone] = np.array(offset) + (world[parent] if parent else 0)
        inverse = np.tile(np.eye(4), (len(order), 1, 1))
        inverse[:, :3, :3] /= scale
        inverse[:, :3, 3] = [-world[bone] / scale for bone in order]
        self.joints = np.zeros((8, 4), np.uint16)
        self.joints[:, 1] = 1
        self.weights = np.tile([0.75, 0.25, 0.0, 0.0], (8, 1)).astype(np.float32)
        attributes = {
            "POSITION": self.accessor(self.vertices.astype(np.float32), 5126, "VEC3"),
            "TEXCOORD_0": self.accessor(np.tile([0.25, 0.75], (8, 1)).astype(np.float32), 5126, "VEC2"),
            "JOINTS_0": self.accessor(self.joints, 5123, "VEC4"),
            "WEIGHTS_0": self.accessor(self.weights, 5126, "VEC4"),
        }
        indices = self.accessor(_BOX.astype(np.uint16).ravel(), 5123, "SCALAR")
        primitive = {"attributes": attributes, "indices": indices, "material": 0}
        self.document["meshes"] = [{"name": "box", "primitives": [primitive]}]
        matrices = self.accessor(inverse.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32), 5126, "MAT4")
        self.document["skins"] = [{"joints": list(range(len(order))), "inverseBindMatrices": matrices}]
        picture = io.BytesIO()
        Image.fromarray(np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 9, 9]]], np.uint8)).save(picture, "PNG")
        uri = "data:image/png;base64," + base64.b64encode(picture.getvalue()).decode()
        self.document |= {
            "images": [{"uri": uri}],
            "textures": [{"source": 0}],
            "materials": [{"name": "cloth", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        }
        human = {bone: {"node": number} for number, bone in enumerate(order)}
        self.document["extensions"] = {"VRMC_vrm": {"humanoid": {"humanBones": human}}}

    def accessor(self, values: NDArray[Any], kind: int, shape: str) -> int:
        start = len(self.data)
        self.data += values.tobytes()
        self.data += bytes(-len(self.data) % 4)
        self.document["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": values.nbytes})
        view = len(self.document["bufferViews"]) - 1
        self.document["accessors"].append(
            {"bufferView": view, "componentType": kind, "count": len(values), "type": shape}
        )
        return len(self.document["accessors"]) - 1

    def bytes(self) -> bytes:
        self.document["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.document).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(self.data), 0x004E4942) + bytes(self.data)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def written(self, folder: Path) -> Path:
        path = folder / "figure.vrm"
        path.write_bytes(self.bytes())
        return path


def test_a_vrm_comes_in_with_skeleton_weights_and_texture(tmp_path: Path):
    figure = Figure()
    character = read_character(figure.written(tmp_path))
    assert character.notes == ()
    assert is_closed(character.mesh)
    assert np.allclose(character.mesh.vertices, figure.vertices, atol=1e-6)
    assert character.rig is not None
    assert character.skin is not None
    bones = character.rig.skeleton.humanoid
    assert character.rig.file_names[bones["left_hand"]] == "bone 5"
    assert np.allclose(character.rig.bind[bones["left_hand"], :3, 3], [0.75, 1.5, 0], atol=1e-6)
    assert character.rig.weights is not None
    assert np.allclose(character.rig.weights[:, [bones["hips"], bones["spine"]]], [0.75, 0.25])
    assert np.allclose(character.skin.colours, [0, 0, 1], atol=1e-6)
    assert character.skin.materials[0].name == "cloth"
    assert set(character.skin.triangle_materials) == {0}
    assert np.array_equal(read_mesh(tmp_path / "figure.vrm").triangles, character.mesh.triangles)


@pytest.mark.parametrize("scale", [0.01, 100.0])
def test_a_scaled_armature_changes_nothing(tmp_path: Path, scale: float):
    plain, scaled = (read_character(Figure(s).written(tmp_path)) for s in (1.0, scale))
    assert np.allclose(scaled.mesh.vertices, plain.mesh.vertices, atol=1e-4)
    assert plain.rig is not None
    assert scaled.rig is not None
    assert np.allclose(scaled.rig.bind, plain.rig.bind, atol=1e-4)


def test_a_figure_that_faces_back_is_turned_with_its_rig(tmp_path: Path):
    character = read_character(Figure(turned=True).written(tmp_path))
    assert character.rig is not None
    bones = character.rig.skeleton.humanoid
    assert character.rig.bind[bones["left_hand"], 0, 3] > 0.7
    assert volume(character.mesh) > 0


def test_a_skin_of_several_trees_becomes_one(tmp_path: Path):
    figure = Figure()
    hips = figure.document["nodes"][0]
    hips["children"].remove(9)
    figure.document["nodes"][16]["children"].append(9)
    figure.document["nodes"][9]["translation"] = [0.1, 0.95, 0]
    character = read_character(figure.written(tmp_path))
    assert character.rig is not None
    assert (character.rig.skeleton.parents < 0).sum() == 1
    assert np.allclose(
        character.rig.bind[character.rig.skeleton.humanoid["left_foot"], :3, 3], [0.1, 0.08, 0], atol=1e-6
    )


def test_centimetres_are_noticed_or_given(tmp_path: Path):
    text = "\n".join(f"v {x * 100} {y * 170} {z * 30}" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    path = tmp_path / "box.obj"
    path.write_text(text + "\n" + "\n".join("f " + " ".join(str(c + 1) for c in quad) for quad in _QUADS))
    guessed = read_character(path)
    assert np.ptp(guessed.mesh.vertices[:, 1]) == pytest.approx(1.7)
    assert "centimetres" in guessed.notes[0]
    assert np.ptp(read_character(path, unit_m=0.1).mesh.vertices[:, 1]) == pytest.approx(17)


def test_a_rig_beside_an_obj_is_taken(tmp_path: Path):
    (tmp_path / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    bones = [
        {"name": "LeftArm", "parent": "Hips", "head": [0.2, 1, 0]},
        {"name": "Hips", "parent": None, "head": [0, 1, 0]},
    ]
    (tmp_path / "box.rig.json").write_text(json.dumps({"bones": bones}))
    rig = read_character(tmp_path / "box.obj").rig
    assert rig is not None
    assert rig.file_names == ("Hips", "LeftArm")
    assert rig.skeleton.parents.tolist() == [-1, 0]
    bones[1]["parent"] = "LeftArm"
    (tmp_path / "box.rig.json").write_text(json.dumps({"bones": bones}))
    with pytest.raises(FileError, match="circle"):
        read_character(tmp_path / "box.obj")


def test_vertices_without_weight_follow_their_neighbours_and_are_told(tmp_path: Path):
    figure = Figure()
    view = figure.document["bufferViews"][figure.document["accessors"][3]["bufferView"]]
    figure.data[view["byteOffset"] : view["byteOffset"] + 32] = bytes(32)
    character = read_character(figure.written(tmp_path))
    assert character.rig is not None
    assert character.rig.weights is not None
    assert np.allclose(character.rig.weights.sum(axis=1), 1)
    assert "2 vertices without a bone near (" in character.notes[0]


def test_a_bare_mesh_cannot_be_bound(tmp_path: Path):
    (tmp_path / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    with pytest.raises(FileError, match="no skeleton"):
        bound_character(read_character(tmp_path / "bare.obj"))


def test_a_glb_cut_off_anywhere_is_told_in_one_line(tmp_path: Path):
    whole, path = Figure().bytes(), tmp_path / "cut.glb"
    for end in [*range(40), *range(40, len(whole), 97), len(whole) - 1]:
        path.write_bytes(whole[:end])
        with pytest.raises(FileError, match=r"cut\.glb") as caught:
            read_character(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("where", "value", "message"),
    [
        (("accessors", 0, "count"), 900, "cut off"),
        (("accessors", 0, "type"), "VEC7", "not valid glTF"),
        (("meshes", 0, "primitives", 0, "indices"), 99, "not valid glTF"),
        (("skins", 0, "joints"), [0], "names joint 1 of a skin with 1 joints"),
        (("meshes", 0, "primitives"), [], "no triangles"),
        (("nodes", 15, "children"), [15], "not valid glTF"),
        (("extensionsRequired",), ["KHR_draco_mesh_compression"], "export it without compression"),
        (("buffers", 0, "uri"), "../secret.bin", "needs the file"),
    ],
)
def test_a_broken_glb_is_told_why(tmp_path: Path, where: tuple[Any, ...], value: Any, message: str):
    figure = Figure()
    figure.bytes()
    place: Any = figure.document
    for step in where[:-1]:
        place = place[step]
    place[where[-1]] = value
    text = json.dumps(figure.document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(figure.data), 0x004E4942) + bytes(figure.data)
    path = tmp_path / "broken.glb"
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    with pytest.raises(FileError, match=message):
        read_character(path)


@pytest.mark.skipif(not _MESHES.is_dir(), reason="needs the shared meshes beside the repository")
def test_a_real_glb_has_its_bones_named():
    character = read_character(_MESHES / "human-male.glb")
    assert character.rig is not None
    assert character.rig.weights is not None
    bones = character.rig.skeleton.humanoid
    assert {bone: character.rig.file_names[j] for bone, j in bones.items()}["left_lower_leg"] == "calf_l"
    assert len(bones) == 22
    assert np.allclose(character.rig.weights.sum(axis=1), 1)
    assert character.mesh.vertices[:, 1].min() == pytest.approx(0)
    assert any("separate pieces" in note for note in character.notes)
    assert len(read_glb(_MESHES / "human-male.glb").parts) == 1


@pytest.mark.skipif(not _MESHES.is_dir(), reason="needs the shared meshes beside the repository")
def test_a_real_body_with_a_rig_beside_it_keeps_its_mesh():
    character = read_character(_MESHES / "makehuman_body.obj")
    assert character.rig is not None
    assert character.notes == ()
    assert np.array_equal(character.mesh.quads, read_mesh(_MESHES / "makehuman_body.obj").quads)
    joints = character.rig.bind[list(character.rig.skeleton.humanoid.values()), :3, 3]
    assert joints[:, 1].min() > 0
    assert len(character.rig.skeleton.humanoid) == 22
