"""Binary glTF 2.0 in (Khronos' specification), VRM included: what a scene shows when nothing is animated.

Only what a character needs is read: triangles, skins, node transforms, texture coordinates and base colours.
"""

import base64
import binascii
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.mesh import Mesh
from devices.errors import FileError

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_UNREADABLE = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


@dataclass(frozen=True, eq=False)
class GlbMaterial:
    """colour: (4,) linear, with opacity. image: the base colour's encoded picture (PNG, JPEG), or None."""

    name: str
    colour: tuple[float, float, float, float]
    image: bytes | None


@dataclass(frozen=True, eq=False)
class GlbPart:
    """One primitive of a mesh, skinned into the world.

    vertices: (V, 3); triangles: (F, 3); texture_coordinates: (V, 2) or None, v downwards.
    joints: (V, K) node numbers; weights: (V, K); without a skin the part's own node with weight 1.
    material: number in `GlbScene.materials`, -1 for none.
    """

    name: str
    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]
    texture_coordinates: NDArray[np.float64] | None
    joints: NDArray[np.int32]
    weights: NDArray[np.float64]
    material: int


@dataclass(frozen=True, eq=False)
class GlbScene:
    """nodes: names; parents: (N,) -1 for roots; transforms: (N, 4, 4) `T_world_node`; skin_nodes: joints of any skin.

    humanoid: node number by VRM's bone name as the file has it (`leftUpperArm`), empty outside VRM.
    """

    nodes: tuple[str, ...]
    parents: NDArray[np.int32]
    transforms: NDArray[np.float64]
    skin_nodes: tuple[int, ...]
    parts: tuple[GlbPart, ...]
    materials: tuple[GlbMaterial, ...]
    humanoid: dict[str, int]


def read_glb(path: Path) -> GlbScene:
    """The scene in a GLB or VRM file, in metres, Y up. Raises FileError saying what is broken or not supported."""
    try:
        return _Reader(path).scene()
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise FileError(f"{path}: not valid glTF ({type(error).__name__}: {error})") from None


def glb_mesh(scene: GlbScene) -> Mesh:
    """All parts, one after the other, as one mesh of triangles."""
    parts = scene.parts
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    vertices = np.concatenate([np.empty((0, 3)), *(part.vertices for part in parts)])
    triangles = [part.triangles + np.int32(start) for part, start in zip(parts, starts, strict=False)]
    return Mesh(vertices, np.empty((0, 4), np.int32), np.concatenate([np.empty((0, 3), np.int32), *triangles]))


class _Reader:
    """A file while it is being read."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.document, self.binary = _chunks(path, path.read_bytes())
        unreadable = sorted({*self.document.get("extensionsRequired", [])} & {*_UNREADABLE})
        if unreadable:
            raise FileError(f"{path}: it is compressed with {unreadable[0]}: export it without compression")

    def scene(self) -> GlbScene:
        nodes = self.document.get("nodes", [])
        parents = np.full(len(nodes), -1, np.int32)
        for number, node in enumerate(nodes):
            parents[node.get("children", [])] = number
        transforms = _world_transforms(nodes, parents)
        parts = [part for number in _shown(self.document, nodes) for part in self._parts(number, transforms)]
        joints = sorted({joint for skin in self.document.get("skins", []) for joint in skin["joints"]})
        names = tuple(str(node.get("name", f"node {number}")) for number, node in enumerate(nodes))
        materials = tuple(self._material(m) for m in self.document.get("materials", []))
        return GlbScene(names, parents, transforms, tuple(joints), tuple(parts), materials, _vrm_bones(self.document))

    def _parts(self, number: int, transforms: NDArray[np.float64]) -> Iterator[GlbPart]:
        node = self.document["nodes"][number]
        if "mesh" not in node:
            return
        mesh = self.document["meshes"][node["mesh"]]
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) in (4, 5, 6):
                yield self._part(str(mesh.get("name", f"mesh {node['mesh']}")), primitive, number, transforms)

    def _part(self, name: str, primitive: Any, number: int, transforms: NDArray[np.float64]) -> GlbPart:
        attributes = primitive["attributes"]
        vertices = self._accessor(attributes["POSITION"])
        count = len(vertices)
        indices = self._accessor(primitive["indices"]) if "indices" in primitive else np.arange(count)
        triangles = _triangles(indices.astype(np.int64).ravel(), primitive.get("mode", 4))
        if triangles.size and not 0 <= triangles.min() <= triangles.max() < count:
            raise FileError(f"{self.path}: mesh {name!r} names vertex {triangles.max()}: it has 0 to {count - 1}")
        if not np.isfinite(vertices).all():
            raise FileError(f"{self.path}: mesh {name!r} has a vertex position that is no finite number")
        skin = self.document["nodes"][number].get("skin")
        if skin is None or "JOINTS_0" not in attributes:
            joints, weights = np.full((count, 1), number, np.int32), np.ones((count, 1))
            placed = vertices @ transforms[number, :3, :3].T + transforms[number, :3, 3]
        else:
            joints, weights, placed = self._skinned(vertices, attributes, self.document["skins"][skin], transforms)
        coordinates = self._accessor(attributes["TEXCOORD_0"]) if "TEXCOORD_0" in attributes else None
        return GlbPart(name, placed, triangles, coordinates, joints, weights, primitive.get("material", -1))

    def _skinned(
        self, vertices: NDArray[np.float64], attributes: Any, skin: Any, transforms: NDArray[np.float64]
    ) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
        """Node numbers (V, K), weights (V, K) that sum to 1 or are all 0, vertices (V, 3) as the nodes now stand."""
        nodes = np.array(skin["joints"], np.int32)
        inverse = np.tile(np.eye(4), (len(nodes), 1, 1))
        if "inverseBindMatrices" in skin:
            inverse = self._accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        sets = [n for n in range(8) if f"JOINTS_{n}" in attributes]
        slots = np.concatenate([self._accessor(attributes[f"JOINTS_{n}"]) for n in sets], axis=1).astype(np.int64)
        weights = np.concatenate([self._accessor(attributes[f"WEIGHTS_{n}"]) for n in sets], axis=1)
        weights = np.maximum(np.nan_to_num(weights), 0.0)
        if slots.max(initial=0) >= len(nodes):
            raise FileError(f"{self.path}: a vertex names joint {slots.max()} of a skin with {len(nodes)} joints")
        total = weights.sum(axis=1, keepdims=True)
        weights = np.divide(weights, total, out=np.zeros_like(weights), where=total > 1e-6)
        move = (transforms[nodes] @ inverse[: len(nodes)])[:, :3]
        placed = np.einsum("vk,vkij,vj->vi", weights, move[slots], np.c_[vertices, np.ones(len(vertices))])
        loose = total[:, 0] <= 1e-6
        placed[loose] = np.c_[vertices[loose], np.ones(loose.sum())] @ move[0].T
        return nodes[slots], weights, placed

    def _material(self, material: Any) -> GlbMaterial:
        surface = material.get("pbrMetallicRoughness", {})
        colour = tuple(float(c) for c in surface.get("baseColorFactor", (1, 1, 1, 1)))
        texture = surface.get("baseColorTexture", {}).get("index")
        source = None if texture is None else self.document["textures"][texture].get("source")
        image = None if source is None else self._image(self.document["images"][source])
        return GlbMaterial(str(material.get("name", "material")), (colour[0], colour[1], colour[2], colour[3]), image)

    def _image(self, image: Any) -> bytes | None:
        if "bufferView" in image:
            view = self.document["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            return self._buffer(view["buffer"])[start : start + view["byteLength"]]
        return self._resource(image["uri"]) if "uri" in image else None

    def _accessor(self, number: int) -> NDArray[np.float64]:
        """(N, C) float64; normalised integers become shares."""
        accessor = self.document["accessors"][number]
        width, kind = _WIDTHS[accessor["type"]], np.dtype(_COMPONENTS[accessor["componentType"]])
        count = accessor["count"]
        if "sparse" in accessor:
            raise FileError(f"{self.path}: accessor {number} is sparse: export it with plain accessors")
        if "bufferView" not in accessor:
            return np.zeros((count, width))
        view = self.document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        step = view.get("byteStride", kind.itemsize * width)
        data = self._buffer(view["buffer"])
        needed = start + (count - 1) * step + kind.itemsize * width
        if count < 0 or start < 0 or (count and needed > len(data)):
            raise FileError(f"{self.path}: accessor {number} ends at byte {needed} of {len(data)}; the file is cut off")
        values = np.ndarray((count, width), kind, data, start, (step, kind.itemsize)).astype(np.float64)
        return values / np.iinfo(kind).max if accessor.get("normalized") and kind.kind in "iu" else values

    def _buffer(self, number: int) -> bytes:
        uri = self.document["buffers"][number].get("uri")
        return self.binary if uri is None else self._resource(uri)

    def _resource(self, uri: str) -> bytes:
        """Embedded data, or a file beside this one."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error:
                raise FileError(f"{self.path}: its embedded data is not valid base64") from None
        beside = self.path.parent / unquote(uri)
        if beside.parent.resolve() != self.path.parent.resolve() or not beside.is_file():
            raise FileError(f"{self.path}: it needs the file {uri} beside it")
        return beside.read_bytes()


def _chunks(path: Path, data: bytes) -> tuple[Any, bytes]:
    """The JSON document and the binary chunk of a GLB; a text `.gltf` has only the former."""
    text, binary = data, b""
    if data[:4] == b"glTF":
        if len(data) < 20 or struct.unpack_from("<I", data, 8)[0] > len(data):
            raise FileError(f"{path}: it is {len(data)} bytes long, shorter than its header says; the file is cut off")
        size, kind = struct.unpack_from("<II", data, 12)
        if kind != _JSON:
            raise FileError(f"{path}: its first chunk is not JSON; this is no glTF 2.0 file")
        text, rest = data[20 : 20 + size], data[20 + size :]
        if len(rest) >= 8 and struct.unpack_from("<I", rest, 4)[0] == _BINARY:
            binary = rest[8 : 8 + struct.unpack_from("<I", rest)[0]]
    try:
        document = json.loads(text)
    except (UnicodeDecodeError, json.JSONDecodeError):
        raise FileError(f"{path}: not a GLB or glTF file: it has no JSON document") from None
    if not isinstance(document, dict):
        raise FileError(f"{path}: not a GLB or glTF file: its JSON is no document")
    return document, binary


def _world_transforms(nodes: list[Any], parents: NDArray[np.int32]) -> NDArray[np.float64]:
    local = np.array([_local_transform(node) for node in nodes]).reshape(-1, 4, 4)
    world: dict[int, NDArray[np.float64]] = {}

    def of(number: int) -> NDArray[np.float64]:
        if number not in world:
            parent = int(parents[number])
            world[number] = local[number] if parent < 0 else of(parent) @ local[number]
        return world[number]

    return np.array([of(number) for number in range(len(nodes))]).reshape(-1, 4, 4)


def _local_transform(node: Any) -> NDArray[np.float64]:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    transform = np.eye(4)
    turn = Rotation.from_quat(node.get("rotation", (0, 0, 0, 1))).as_matrix()
    transform[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), float)
    transform[:3, 3] = node.get("translation", (0, 0, 0))
    return transform


def _shown(document: Any, nodes: list[Any]) -> Iterator[int]:
    """The nodes of the scene that is shown, parents before children."""
    scenes = document.get("scenes", [])
    waiting = list(scenes[document.get("scene", 0)].get("nodes", [])) if scenes else list(range(len(nodes)))
    seen: set[int] = set()
    while waiting:
        number = waiting.pop(0)
        if number not in seen:
            seen.add(number)
            yield number
            waiting.extend(nodes[number].get("children", []))


def _triangles(indices: NDArray[np.int64], mode: int) -> NDArray[np.int32]:
    """(F, 3) of a list (4), a strip (5) or a fan (6)."""
    if mode == 4:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3).astype(np.int32)
    first = np.zeros(max(len(indices) - 2, 0), np.int64) if mode == 6 else np.arange(max(len(indices) - 2, 0))
    second = np.arange(1, len(first) + 1)
    third = second + 1
    if mode == 5:
        second, third = np.where(first % 2, third, second), np.where(first % 2, second, third)
    return indices[np.stack([first, second, third], axis=1)].astype(np.int32)


def _vrm_bones(document: Any) -> dict[str, int]:
    """Node number by bone name of VRM 1 (`VRMC_vrm`) or VRM 0 (`VRM`)."""
    extensions = document.get("extensions", {})
    if "VRMC_vrm" in extensions:
        return {bone: int(at["node"]) for bone, at in extensions["VRMC_vrm"]["humanoid"]["humanBones"].items()}
    if "VRM" in extensions:
        return {bone["bone"]: int(bone["node"]) for bone in extensions["VRM"]["humanoid"]["humanBones"]}
    return {}
