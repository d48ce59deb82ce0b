"""A skinned, animated character as one binary glTF 2.0 file (GLB), as Khronos' glTF 2.0 specification has it.

glTF's axes, units and quaternions are the system's own (Y up, metres, x y z w), so nothing is turned or scaled.
"""

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from capture.colour import linear
from capture.joint_presets import renamed, renamed_skeleton
from capture.scene import CLAY
from deformation.character import Character
from deformation.character_files import Skin
from deformation.mesh import vertex_normals
from deformation.mesh_files.glb import GlbMaterial
from devices.errors import SixpointError
from reconstruction.motion import Motion
from reconstruction.skeleton import Skeleton

if TYPE_CHECKING:
    from pygltflib import GLTF2

_FLOAT, _UINT32, _UINT16, _UINT8 = 5126, 5125, 5123, 5121
_COMPONENT = {np.dtype(np.float32): _FLOAT, np.dtype(np.uint32): _UINT32}
_COMPONENT |= {np.dtype(np.uint16): _UINT16, np.dtype(np.uint8): _UINT8}
_SHAPE = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_VERTEX_TARGET, _INDEX_TARGET = 34962, 34963


def write_glb(
    character: Character,
    motion: Motion,
    path: str | Path,
    colours: ArrayLike = CLAY,
    skin: Skin | None = None,
    joint_names: str | None = None,
) -> None:
    """Writes the character with its skeleton, weights and the motion, beside `path` and renamed into place.

    motion: of the character's tree of joints; its own bone lengths are used. colours: sRGB, (3,) or (V, 3).
    skin: of the character's own mesh, with its materials and pictures; then `colours` are not used.
    joint_names: one of `capture.joint_presets`, or None to keep the skeleton's own.
    Raises SixpointError where the motion belongs to another skeleton, OSError.
    """
    if not character.skeleton.same_tree(motion.skeleton):
        raise SixpointError(f"{path}: the motion {motion.name!r} moves another skeleton than {character.name!r} has")
    if joint_names is not None:
        character = replace(character, skeleton=renamed_skeleton(character.skeleton, joint_names))
        motion = renamed(motion, joint_names)
    path = Path(path)
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_bytes(b"".join(_document(character, motion, colours, skin).save_to_bytes()))
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


class GlbBuffer:
    """The binary part, and the accessors that say what lies where in it."""

    def __init__(self, gltf: "GLTF2") -> None:
        self._gltf = gltf
        self.data = bytearray()

    def add(self, values: NDArray[Any], target: int | None = None, bounds: bool = False) -> int:
        """Appends (N,) or (N, C) values; returns their accessor's number."""
        from pygltflib import Accessor

        values = np.ascontiguousarray(values)
        rows = values.reshape(len(values), -1)
        accessor = Accessor(
            bufferView=self._add_view(values.tobytes(), target),
            componentType=_COMPONENT[values.dtype],
            count=len(values),
            type=_SHAPE[rows.shape[1]],
            min=rows.min(axis=0).tolist() if bounds else None,
            max=rows.max(axis=0).tolist() if bounds else None,
        )
        self._gltf.accessors.append(accessor)
        return len(self._gltf.accessors) - 1

    def add_picture(self, data: bytes) -> int:
        """Appends an encoded PNG or JPEG; returns the number of a texture that shows it."""
        from pygltflib import Image, Texture

        kind = "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"
        self._gltf.images.append(Image(bufferView=self._add_view(data, None), mimeType=kind))
        self._gltf.textures.append(Texture(source=len(self._gltf.images) - 1))
        return len(self._gltf.textures) - 1

    def _add_view(self, data: bytes, target: int | None) -> int:
        from pygltflib import BufferView

        self.data.extend(b"\0" * (-len(self.data) % 4))
        view = BufferView(buffer=0, byteOffset=len(self.data), byteLength=len(data), target=target)
        self.data.extend(data)
        self._gltf.bufferViews.append(view)
        return len(self._gltf.bufferViews) - 1


def _document(character: Character, motion: Motion, colours: ArrayLike, skin: Skin | None) -> "GLTF2":
    from pygltflib import GLTF2, Asset, Buffer, Node, Scene, Skin

    gltf = GLTF2(asset=Asset(version="2.0", generator="sixpoint"))
    buffer = GlbBuffer(gltf)
    joints = len(character.skeleton)
    gltf.nodes = _joint_nodes(character, motion.skeleton)
    gltf.nodes.append(Node(name=character.name, mesh=0, skin=0))
    gltf.scenes, gltf.scene = [Scene(nodes=[0, joints])], 0
    gltf.materials = [_plain_material(colours)]
    numbers = np.zeros(len(character.mesh.triangulated), np.int32)
    if skin is not None:
        gltf.materials += [_material(material, buffer) for material in skin.materials]
        numbers = skin.triangle_materials + 1
    attributes = _attributes(character, buffer)
    if skin is not None and skin.texture_coordinates is not None:
        attributes.TEXCOORD_0 = buffer.add(skin.texture_coordinates.astype(np.float32), _VERTEX_TARGET)
    elif skin is None and np.ndim(colours) == 2:
        attributes.COLOR_0 = buffer.add(linear(colours).astype(np.float32), _VERTEX_TARGET)
    gltf.meshes = [_mesh(character, attributes, numbers, buffer)]
    columns = character.bind_inverse.transpose(0, 2, 1).reshape(joints, 16)  # glTF stores matrices by columns
    inverse_bind = buffer.add(columns.astype(np.float32))
    gltf.skins = [Skin(name=character.name, joints=list(range(joints)), skeleton=0, inverseBindMatrices=inverse_bind)]
    gltf.animations = [animation_of(motion, buffer)]
    gltf.buffers = [Buffer(byteLength=len(buffer.data))]
    gltf.set_binary_blob(bytes(buffer.data))
    return gltf


def _joint_nodes(character: Character, skeleton: Skeleton) -> list[Any]:
    """One node a joint, in the skeleton's order, standing in the bind pose."""
    from pygltflib import Node

    world = Rotation.from_matrix(character.bind[:, :3, :3])
    nodes = []
    for joint, parent in enumerate(skeleton.parents):
        local = world[joint] if parent < 0 else world[int(parent)].inv() * world[joint]
        place = character.bind[joint, :3, 3] if parent < 0 else skeleton.offsets[joint]
        nodes.append(
            Node(
                name=skeleton.names[joint],
                translation=place.tolist(),
                rotation=local.as_quat().tolist(),
                children=list(skeleton.children[joint]) or None,
            )
        )
    return nodes


def _attributes(character: Character, buffer: GlbBuffer) -> Any:
    from pygltflib import Attributes

    mesh = character.mesh
    weights = character.vertex_weights.astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    joints = np.where(weights > 0, character.vertex_joints, 0)
    joint_type = np.uint8 if len(character.skeleton) <= 256 else np.uint16
    return Attributes(
        POSITION=buffer.add(mesh.vertices.astype(np.float32), _VERTEX_TARGET, bounds=True),
        NORMAL=buffer.add(_unit(vertex_normals(mesh.vertices, mesh.triangulated)), _VERTEX_TARGET),
        JOINTS_0=buffer.add(joints.astype(joint_type), _VERTEX_TARGET),
        WEIGHTS_0=buffer.add(weights, _VERTEX_TARGET),
    )


def _mesh(character: Character, attributes: Any, materials: NDArray[np.int32], buffer: GlbBuffer) -> Any:
    """One primitive a material, all on the same vertices. materials: (F,) number of each triangle's."""
    from pygltflib import Mesh, Primitive

    primitives = []
    for material in np.unique(materials).tolist():
        indices = character.mesh.triangulated[materials == material].astype(np.uint32).ravel()
        number = buffer.add(indices, _INDEX_TARGET)
        primitives.append(Primitive(attributes=attributes, indices=number, material=material))
    return Mesh(name=character.name, primitives=primitives)


def _unit(normals: NDArray[np.float64]) -> NDArray[np.float32]:
    """Of length one even after rounding; a vertex without a face looks up."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-30), [0.0, 1.0, 0.0]).astype(np.float32)


def _plain_material(colours: ArrayLike) -> Any:
    from pygltflib import Material, PbrMetallicRoughness

    colour = [1.0, 1.0, 1.0] if np.ndim(colours) == 2 else linear(colours).tolist()
    surface = PbrMetallicRoughness(baseColorFactor=[*colour, 1.0], metallicFactor=0.0, roughnessFactor=0.65)
    return Material(name="skin", pbrMetallicRoughness=surface)


def _material(material: GlbMaterial, buffer: GlbBuffer) -> Any:
    from pygltflib import Material, PbrMetallicRoughness, TextureInfo

    surface = PbrMetallicRoughness(baseColorFactor=list(material.colour), metallicFactor=0.0, roughnessFactor=0.65)
    if material.image is not None:
        surface.baseColorTexture = TextureInfo(index=buffer.add_picture(material.image))
    transparency = "BLEND" if material.colour[3] < 1.0 else "OPAQUE"
    return Material(name=material.name, pbrMetallicRoughness=surface, alphaMode=transparency, doubleSided=True)


def animation_of(motion: Motion, buffer: GlbBuffer) -> Any:
    """A rotation track a joint that turns, and the root's translation, a key a frame, linear between them."""
    from pygltflib import Animation, AnimationChannel, AnimationChannelTarget, AnimationSampler

    animation = Animation(name=motion.name, samplers=[], channels=[])
    times = buffer.add((np.arange(len(motion)) / motion.fps).astype(np.float32), bounds=True)

    def track(joint: int, path: str, values: NDArray[np.float64]) -> None:
        sampler = AnimationSampler(input=times, output=buffer.add(values.astype(np.float32)), interpolation="LINEAR")
        animation.samplers.append(sampler)
        target = AnimationChannelTarget(node=joint, path=path)
        animation.channels.append(AnimationChannel(sampler=len(animation.samplers) - 1, target=target))

    track(0, "translation", motion.root_positions)
    rotations = _same_hemisphere(motion.rotations)
    for joint in np.flatnonzero(~motion.skeleton.is_end):
        track(int(joint), "rotation", rotations[:, joint])
    return animation


def _same_hemisphere(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, J, 4) the same rotations, each on the side of the one before, so that interpolation takes the short way."""
    if len(rotations) < 2:
        return rotations
    turned = np.sign(np.sum(rotations[1:] * rotations[:-1], axis=-1))
    turned[turned == 0] = 1
    signs = np.concatenate([np.ones((1, rotations.shape[1])), np.cumprod(turned, axis=0)])
    return rotations * signs[..., None]
