"""The GLB is read back with pygltflib and this file's own forward kinematics, and judged by the Khronos validator."""

import importlib.util
import io
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pygltflib import GLTF2
from scipy.spatial.transform import Rotation

from capture.glb import write_glb
from deformation.character import mannequin_character
from deformation.character_files import Skin
from deformation.mesh_files.glb import GlbMaterial, read_glb
from devices.errors import SixpointError
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Motion
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

TYPES = {5126: np.float32, 5125: np.uint32, 5123: np.uint16, 5121: np.uint8}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}

VALIDATE = """
const validator = require('gltf-validator'), fs = require('fs');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])), {maxIssues: 100})
  .then(report => console.log(JSON.stringify(report)));
"""


@pytest.fixture(scope="module")
def character():
    return mannequin_character(standard_skeleton(1.75), "low")


@pytest.fixture(scope="module")
def motion(character):
    random = np.random.default_rng(5)
    frames, joints = 40, len(character.skeleton)
    sway = 0.5 * random.normal(size=(1, joints, 3)) * np.sin(np.linspace(0, 7, frames))[:, None, None]
    sway[:, character.skeleton.is_end] = 0
    rotations = Rotation.from_rotvec(sway.reshape(-1, 3)).as_quat().reshape(frames, joints, 4)
    rotations[::3] *= -1
    return Motion(character.skeleton, random.normal(size=(frames, 3)) * 0.1 + [0, 1, 0], rotations, 60.0, "sway")


@pytest.fixture(scope="module")
def path(character, motion, tmp_path_factory):
    path = tmp_path_factory.mktemp("glb") / "character.glb"
    write_glb(character, motion, path)
    return path


def values(gltf: GLTF2, accessor_number: int) -> np.ndarray:
    accessor = gltf.accessors[accessor_number]
    view = gltf.bufferViews[accessor.bufferView]
    data = gltf.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    array = np.frombuffer(data, TYPES[accessor.componentType])
    return array.reshape(accessor.count, WIDTHS[accessor.type]).squeeze()


def posed_nodes(gltf: GLTF2, frame: int | None) -> np.ndarray:
    """(N, 4, 4) world transforms of the nodes as the file says: at rest, or at one key of the animation."""
    translations = [np.array(node.translation or [0, 0, 0]) for node in gltf.nodes]
    rotations = [np.array(node.rotation or [0, 0, 0, 1]) for node in gltf.nodes]
    if frame is not None:
        for channel in gltf.animations[0].channels:
            key = values(gltf, gltf.animations[0].samplers[channel.sampler].output)[frame]
            (translations if channel.target.path == "translation" else rotations)[channel.target.node] = key
    world = np.tile(np.eye(4), (len(gltf.nodes), 1, 1))
    parents = {child: number for number, node in enumerate(gltf.nodes) for child in node.children or ()}

    def place(number: int) -> np.ndarray:
        local = np.eye(4)
        local[:3, :3], local[:3, 3] = Rotation.from_quat(rotations[number]).as_matrix(), translations[number]
        return place(parents[number]) @ local if number in parents else local

    for number in range(len(gltf.nodes)):
        world[number] = place(number)
    return world


def skinned(gltf: GLTF2, frame: int | None) -> np.ndarray:
    attributes = gltf.meshes[0].primitives[0].attributes
    inverse_bind = values(gltf, gltf.skins[0].inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    moved = posed_nodes(gltf, frame)[gltf.skins[0].joints] @ inverse_bind
    corners = np.column_stack([values(gltf, attributes.POSITION), np.ones(len(values(gltf, attributes.POSITION)))])
    blended = np.einsum("vk,vkij->vij", values(gltf, attributes.WEIGHTS_0), moved[values(gltf, attributes.JOINTS_0)])
    return np.einsum("vij,vj->vi", blended, corners)[:, :3]


def test_at_rest_the_skin_stands_where_the_mesh_does(character, path):
    gltf = GLTF2().load(path)
    assert np.abs(skinned(gltf, None) - character.mesh.vertices).max() < 1e-5


def test_every_key_moves_the_joints_as_our_kinematics_does(motion, path):
    gltf = GLTF2().load(path)
    expected = world_transforms(motion.skeleton, motion.root_positions, motion.rotations)
    for frame in (0, 17, 39):
        assert np.abs(posed_nodes(gltf, frame)[: len(motion.skeleton)] - expected[frame]).max() < 1e-5


def test_the_skin_follows_as_plain_linear_blending(character, motion, path):
    gltf = GLTF2().load(path)
    world = world_transforms(motion.skeleton, motion.root_positions, motion.rotations)[23] @ character.bind_inverse
    corners = np.column_stack([character.mesh.vertices, np.ones(len(character.mesh.vertices))])
    blended = np.einsum("vk,vkij->vij", character.vertex_weights, world[character.vertex_joints])
    expected = np.einsum("vij,vj->vi", blended, corners)[:, :3]
    assert np.abs(skinned(gltf, 23) - expected).max() < 2e-5


def test_keys_interpolate_the_short_way(motion, path):
    gltf = GLTF2().load(path)
    for channel in gltf.animations[0].channels:
        if channel.target.path == "rotation":
            keys = values(gltf, gltf.animations[0].samplers[channel.sampler].output)
            assert (np.sum(keys[1:] * keys[:-1], axis=1) > 0).all()
    times = values(gltf, gltf.animations[0].samplers[0].input)
    assert np.allclose(times, np.arange(len(motion)) / 60)


def test_names_and_tree_are_the_skeletons(character, path):
    gltf = GLTF2().load(path)
    names = [gltf.nodes[joint].name for joint in gltf.skins[0].joints]
    assert tuple(names) == character.skeleton.names
    for joint, children in enumerate(character.skeleton.children):
        assert tuple(gltf.nodes[joint].children or ()) == children


def test_vertex_colours_are_linear(character, motion, tmp_path):
    colours = np.full((len(character.mesh.vertices), 3), 0.5)
    write_glb(character, motion, tmp_path / "c.glb", colours)
    gltf = GLTF2().load(tmp_path / "c.glb")
    assert np.allclose(values(gltf, gltf.meshes[0].primitives[0].attributes.COLOR_0), 0.2140, atol=1e-4)


def test_textures_and_materials_of_a_character_file_are_kept(character, motion, tmp_path):
    from PIL import Image

    picture = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (8, 8, 3), np.uint8)).save(picture, "PNG")
    materials = (
        GlbMaterial("cloth", (1.0, 0.5, 0.25, 1.0), picture.getvalue()),
        GlbMaterial("glass", (0.1, 0.2, 0.3, 0.5), None),
    )
    faces, vertices = len(character.mesh.triangulated), len(character.mesh.vertices)
    coordinates = np.random.default_rng(1).uniform(0, 1, (vertices, 2))
    numbers = (np.arange(faces) % 3 - 1).astype(np.int32)
    skin = Skin(coordinates, np.ones((vertices, 3)), materials, numbers)
    path = tmp_path / "textured.glb"
    write_glb(character, motion, path, skin=skin)
    back = read_glb(path)
    kept = {m.name: (m.colour, m.image) for m in back.materials}
    assert all(kept[m.name] == (m.colour, m.image) for m in materials)
    by_name = {back.materials[part.material].name if part.material >= 0 else "": part for part in back.parts}
    for name, number in (("cloth", 0), ("glass", 1)):
        part = by_name[name]
        assert len(part.triangles) == (numbers == number).sum()
        assert np.allclose(part.texture_coordinates, coordinates, atol=1e-6)
    validated([path])


def test_a_motion_of_another_skeleton_is_refused_and_leaves_nothing(character, tmp_path):
    other = Skeleton(("a",), np.array([-1], np.int32), np.zeros((1, 3)))
    motion = Motion(other, np.zeros((1, 3)), np.array([[[0.0, 0, 0, 1]]]), 60.0, "other")
    with pytest.raises(SixpointError, match="another skeleton"):
        write_glb(character, motion, tmp_path / "x.glb")
    assert list(tmp_path.iterdir()) == []


def validated(files: list[Path]) -> bool:
    """Whether the validator is there, and then finds nothing wrong."""
    if not shutil.which("node"):
        return False
    if subprocess.run(["node", "-e", "require('gltf-validator')"], capture_output=True).returncode != 0:
        return False
    for file in files:
        done = subprocess.run(["node", "-e", VALIDATE, str(file)], capture_output=True, text=True, check=True)
        report = json.loads(done.stdout)
        assert report["issues"]["numErrors"] == 0, report["issues"]["messages"]
        assert report["issues"]["numWarnings"] == 0, report["issues"]["messages"]
        assert report["info"]["hasSkins"]
    return True


def test_the_khronos_validator_finds_nothing_wrong(character, motion, path, tmp_path):
    coloured, one_pose = tmp_path / "coloured.glb", tmp_path / "pose.glb"
    write_glb(character, motion, coloured, np.full((len(character.mesh.vertices), 3), 0.5))
    first = Motion(motion.skeleton, motion.root_positions[:1], motion.rotations[:1], 60.0)
    write_glb(character, first, one_pose)
    if not validated([path, coloured, one_pose]):
        pytest.skip("node or the npm package gltf-validator is not installed (NODE_PATH says where)")


BLENDER = """
import sys
import bpy, numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 60
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
skin = max((o for o in bpy.data.objects if o.type == "MESH"), key=lambda o: len(o.data.vertices))
rate = bpy.data.actions[0].frame_range[1] / float(sys.argv[3])
bpy.context.scene.frame_set(int(rate * 23), subframe=rate * 23 % 1)
posed = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
mesh, world = posed.to_mesh(), np.array(posed.matrix_world)
corners = np.array([vertex.co[:] for vertex in mesh.vertices]) @ world[:3, :3].T + world[:3, 3]
np.save(sys.argv[2], np.column_stack([corners[:, 0], corners[:, 2], -corners[:, 1]]))
"""


def test_blender_moves_the_skin_as_the_file_says(motion, path, tmp_path):
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("Blender's Python module is not installed (pip install bpy)")
    out = tmp_path / "blender.npy"
    command = [sys.executable, "-c", BLENDER, str(path), str(out), str(len(motion) - 1)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert out.exists(), done.stderr
    assert np.abs(np.load(out) - skinned(GLTF2().load(path), 23)).max() < 1e-5
