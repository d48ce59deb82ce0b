"""Characters from files: GLB and VRM with skeleton, weights and textures; OBJ and PLY bare or with a rig beside."""

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from deformation.character import Character, LatticeSettings, make_character
from deformation.humanoid_structure import humanoid_bones
from deformation.mesh import Mesh
from deformation.mesh_files import read_mesh
from deformation.mesh_files.glb import GlbMaterial, GlbPart, GlbScene, glb_mesh, read_glb
from deformation.mesh_repair import in_metres, repaired
from deformation.painting import UNPAINTED, Painting
from devices.errors import FileError
from devices.frame import frozen
from reconstruction.joint_names import CENTRE_BONES, SIDED_BONES, humanoid_names
from reconstruction.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Rig:
    """A skeleton in a mesh. Its joints' frames stand as the world's in the bind pose, so that rest and bind are one.

    skeleton: joints that are humanoid bones carry VRM's names (`left_upper_arm`), the others their own.
    file_names: (J,) the joints' names in the file. bind: (J, 4, 4) `T_world_joint`.
    weights: (V, J), rows sum to 1, or None where the file has none.
    """

    skeleton: Skeleton
    file_names: tuple[str, ...]
    bind: NDArray[np.float64]
    weights: NDArray[np.float64] | None


@dataclass(frozen=True, eq=False)
class Skin:
    """What a surface looks like.

    texture_coordinates: (V, 2), v downwards as in glTF, or None. colours: (V, 3) sRGB, the texture read at each vertex.
    materials: as in the file; triangle_materials: (F,) the material's number of each of the mesh's triangles, or -1.
    """

    texture_coordinates: NDArray[np.float64] | None
    colours: NDArray[np.float64]
    materials: tuple[GlbMaterial, ...]
    triangle_materials: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Placement:
    """How a file's vertices became the character's: the kept ones, times turn (3, 3) with its scale, plus shift (3,).

    count: how many the file has.
    """

    count: int
    turn: NDArray[np.float64]
    kept: NDArray[np.int64]
    shift: NDArray[np.float64]

    def placed(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """(V', 3) metres of other vertices (V, 3) of the same file's order, such as of another pose."""
        return vertices[self.kept] @ self.turn + self.shift


@dataclass(frozen=True, eq=False)
class CharacterFile:
    """A character as a file has it, in metres, upright, left at +X, its feet on y = 0.

    notes: what was mended or is worth knowing, one line each. placement: what was done to its vertices.
    """

    name: str
    mesh: Mesh
    rig: Rig | None
    skin: Skin | None
    notes: tuple[str, ...]
    placement: Placement | None = None


def read_character(path: str | Path, unit_m: float | None = None) -> CharacterFile:
    """The character in a GLB, VRM, OBJ or PLY file; a rig for the latter two may lie beside it as `NAME.rig.json`.

    unit_m: what one unit of the file is in metres; without it glTF is in metres, and what is then too tall for a person
    is read as centimetres, decimetres, millimetres or inches. Raises FileError naming the file and what is wrong.
    """
    path = Path(path)
    if path.suffix.lower() in (".glb", ".gltf", ".vrm"):
        if not path.is_file():
            raise FileError(f"{path}: no such file")
        return _placed(_from_glb(path, read_glb(path)), unit_m)
    mesh = read_mesh(path)
    rig_path = path.with_name(path.stem + ".rig.json")
    rig = _read_rig(rig_path) if rig_path.is_file() else None
    return _placed(CharacterFile(path.name, mesh, rig, None, ()), unit_m)


def bound_character(
    file: CharacterFile,
    settings: LatticeSettings | None = None,
    own_weights: bool = True,
    painting: Painting = UNPAINTED,
) -> Character:
    """The file's character ready to be moved by poses of its own skeleton (see `deformation.retarget` for others').

    own_weights: keep the file's weights where it has some; otherwise, and without any, heat finds them.
    painting: what is painted over them.
    Raises FileError for a file without a skeleton.
    """
    if file.rig is None:
        raise FileError(f"{file.name}: it has no skeleton: export it with one, or find one with `sixpoint rig`")
    own = Painting(weights=file.rig.weights if own_weights else None)
    return make_character(file.mesh, file.rig.skeleton, file.rig.bind, file.name, settings, painting.over(own))


def _placed(character: CharacterFile, unit_m: float | None) -> CharacterFile:
    """In metres, mended, turned to face +Z where the rig tells, and put on the floor."""
    unit, note = (unit_m, None) if unit_m is not None else in_metres(character.mesh.vertices, character.name)
    turn = np.eye(3) * unit
    bones = character.rig.skeleton.humanoid if character.rig else {}
    if character.rig and "left_upper_leg" in bones and "right_upper_leg" in bones:
        joints = character.rig.bind[:, :3, 3]
        if joints[bones["left_upper_leg"], 0] < joints[bones["right_upper_leg"], 0]:
            turn = turn @ np.diag([-1.0, 1.0, -1.0])
    moved = character.mesh.with_vertices(character.mesh.vertices @ turn)
    mended = repaired(moved, character.name)
    shift = np.array([0.0, -mended.mesh.vertices[:, 1].min(), 0.0])
    notes = (*character.notes, *([note] if note else []), *mended.notes)
    rig = character.rig
    if rig is not None:
        weights = None if rig.weights is None else rig.weights[mended.kept]
        rig = _rig(rig.skeleton.names, rig.file_names, rig.skeleton.parents, rig.bind[:, :3, 3] @ turn + shift, weights)
    skin = None if character.skin is None else _kept_skin(character.skin, moved, mended.mesh, mended.kept)
    mesh = mended.mesh.with_vertices(mended.mesh.vertices + shift)
    placement = Placement(len(moved.vertices), frozen(turn), frozen(mended.kept), frozen(shift))
    return replace(character, mesh=mesh, rig=rig, skin=skin, notes=notes, placement=placement)


def _kept_skin(skin: Skin, before: Mesh, after: Mesh, kept: NDArray[np.int64]) -> Skin:
    """The skin of the vertices and triangles that are left, triangles found again by their corners."""
    material = {
        tuple(sorted(corners)): int(number)
        for corners, number in zip(before.triangulated.tolist(), skin.triangle_materials, strict=True)
    }
    corners = np.sort(kept[after.triangulated], axis=1).tolist()
    coordinates = skin.texture_coordinates
    return Skin(
        None if coordinates is None else frozen(coordinates[kept]),
        frozen(skin.colours[kept]),
        skin.materials,
        frozen(np.array([material.get(tuple(c), -1) for c in corners], np.int32)),
    )


def _rig(
    names: Sequence[str],
    file_names: Sequence[str],
    parents: NDArray[np.int32],
    positions: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
) -> Rig:
    offsets = positions - np.where(parents[:, None] >= 0, positions[parents], 0.0)
    bind = np.tile(np.eye(4), (len(parents), 1, 1))
    bind[:, :3, 3] = positions
    skeleton = Skeleton(tuple(names), frozen(parents), frozen(offsets))
    return Rig(skeleton, tuple(file_names), frozen(bind), None if weights is None else frozen(weights))


def _bone_names(names: Sequence[str], bones: dict[str, int]) -> tuple[str, ...]:
    """Each joint's humanoid bone, else its own name, made different from all bones' and all others'."""
    of_joint = {joint: bone for bone, joint in bones.items()}
    taken = set(of_joint.values())
    result = []
    for joint, name in enumerate(names):
        fitting = of_joint.get(joint)
        if fitting is None:
            fitting = name if name not in taken and not _claims_a_bone(name) else f"joint {joint} {name}"
            taken.add(fitting)
        result.append(fitting)
    return tuple(result)


def _claims_a_bone(name: str) -> bool:
    """Whether the tables of names would take a joint of this name for a humanoid bone."""
    return bool(humanoid_names([name]))


def _read_rig(path: Path) -> Rig:
    """A rig of named bones with their parents' names and the places (3,) of their heads."""
    try:
        bones = json.loads(path.read_text(encoding="utf-8"))["bones"]
        file_names = [str(bone["name"]) for bone in bones]
        above = [bone["parent"] for bone in bones]
        heads = np.array([bone["head"] for bone in bones], float).reshape(len(bones), 3)
        order = _parents_first([-1 if name is None else file_names.index(name) for name in above])
    except (KeyError, TypeError, ValueError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: not a rig of bones with name, parent and head ({error})") from None
    place = {joint: number for number, joint in enumerate(order)}
    names = [file_names[joint] for joint in order]
    parents = np.array([-1 if above[j] is None else place[file_names.index(above[j])] for j in order], np.int32)
    bones_of = humanoid_bones(names, parents, heads[order])
    return _rig(_bone_names(names, bones_of), names, parents, heads[order], None)


def _parents_first(parents: Sequence[int]) -> list[int]:
    """An order in which a joint comes after its parent. Raises ValueError for a circle."""
    order: list[int] = []
    waiting = list(range(len(parents)))
    while waiting:
        ready = [j for j in waiting if parents[j] < 0 or parents[j] in order]
        if not ready:
            raise ValueError("its parents run in a circle")
        order += ready
        waiting = [j for j in waiting if j not in set(ready)]
    return order


def _from_glb(path: Path, scene: GlbScene) -> CharacterFile:
    mesh = glb_mesh(scene)
    if not len(mesh.triangles):
        raise FileError(f"{path}: it shows no triangles; a character needs a surface")
    rig, notes = _glb_rig(path.name, scene) if scene.skin_nodes else (None, ())
    return CharacterFile(path.name, mesh, rig, _glb_skin(scene), notes)


def _glb_rig(name: str, scene: GlbScene) -> tuple[Rig, tuple[str, ...]]:
    """The skins' joints as one skeleton. Vertices that hang on no joint follow the nearest that does."""
    nodes = list(scene.skin_nodes)
    joint_of_node = np.full(len(scene.nodes), -1, np.int64)
    above = _one_root(nodes, [next((a for a in _ancestors(scene, node) if a in set(nodes)), -1) for node in nodes])
    order = _parents_first([-1 if node < 0 else nodes.index(node) for node in above])
    joint_of_node[[nodes[n] for n in order]] = np.arange(len(order))
    parents = np.array([-1 if above[n] < 0 else joint_of_node[above[n]] for n in order], np.int32)
    names = [scene.nodes[nodes[n]] for n in order]
    positions = scene.transforms[[nodes[n] for n in order], :3, 3]
    nearest = np.array([_nearest_joint(scene, node, joint_of_node) for node in range(len(scene.nodes))])
    weights = np.concatenate([_dense(part, nearest, len(nodes)) for part in scene.parts])
    weights, notes = _filled(name, weights, np.concatenate([part.vertices for part in scene.parts]))
    known = {_bone_name(b): int(joint_of_node[n]) for b, n in scene.humanoid.items() if joint_of_node[n] >= 0}
    bones = humanoid_bones(names, parents, positions, {b: j for b, j in known.items() if b is not None})
    return _rig(_bone_names(names, bones), names, parents, positions, weights), notes


def _one_root(nodes: list[int], above: list[int]) -> list[int]:
    """The joint above each, -1 for one root only: other trees of a skin hang on the root of the largest."""
    place = {node: number for number, node in enumerate(nodes)}

    def root(node: int) -> int:
        while above[place[node]] >= 0:
            node = above[place[node]]
        return node

    roots = [root(node) for node in nodes]
    main = max(roots, key=roots.count)
    return [main if parent < 0 and node != main else parent for node, parent in zip(nodes, above, strict=True)]


def _ancestors(scene: GlbScene, node: int) -> list[int]:
    above = []
    while scene.parents[node] >= 0:
        node = int(scene.parents[node])
        above.append(node)
    return above


def _nearest_joint(scene: GlbScene, node: int, joint_of_node: NDArray[np.int64]) -> int:
    """The joint that a node is or hangs on, -1 for none."""
    return next((int(joint_of_node[n]) for n in [node, *_ancestors(scene, node)] if joint_of_node[n] >= 0), -1)


def _dense(part: GlbPart, nearest: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """(V, J) weights, zero rows where a vertex hangs on no joint."""
    weights = np.zeros((len(part.vertices), count + 1))
    rows = np.arange(len(part.vertices))
    for slot in range(part.joints.shape[1]):
        np.add.at(weights, (rows, nearest[part.joints[:, slot]]), part.weights[:, slot])
    return weights[:, :count]


def _filled(
    name: str, weights: NDArray[np.float64], vertices: NDArray[np.float64]
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Rows without weight take those of the nearest vertex with some. Raises FileError where no row has any."""
    total = weights.sum(axis=1)
    loose = total < 1e-6
    if loose.all():
        raise FileError(f"{name}: no vertex hangs on a joint of its skin; export it with weights or without a skin")
    if loose.any():
        _, near = KDTree(vertices[~loose]).query(vertices[loose])
        weights[loose] = weights[~loose][near]
    weights = weights / weights.sum(axis=1, keepdims=True)
    place = ", ".join(f"{x:.3g}" for x in vertices[loose][0]) if loose.any() else ""
    note = f"{name}: {loose.sum()} vertices without a bone near ({place}): they follow their nearest neighbours"
    return weights, (note,) if loose.any() else ()


def _bone_name(vrm: str) -> str | None:
    """`leftUpperArm` as `left_upper_arm`; None for bones this system does not know (fingers, eyes, jaw)."""
    name = "".join(f"_{c.lower()}" if c.isupper() else c for c in vrm)
    known = {*CENTRE_BONES, *(f"{side}_{bone}" for side in ("left", "right") for bone in SIDED_BONES)}
    return name if name in known else None


def _glb_skin(scene: GlbScene) -> Skin:
    parts = scene.parts
    coordinates = None
    if any(part.texture_coordinates is not None for part in parts):
        blank = [np.zeros((len(p.vertices), 2)) for p in parts]
        coordinates = np.concatenate(
            [b if p.texture_coordinates is None else p.texture_coordinates for p, b in zip(parts, blank, strict=True)]
        )
    colours = np.concatenate([_colours(part, scene.materials) for part in parts])
    materials = np.concatenate([np.full(len(part.triangles), part.material, np.int32) for part in parts])
    return Skin(coordinates, colours, scene.materials, materials)


def _colours(part: GlbPart, materials: tuple[GlbMaterial, ...]) -> NDArray[np.float64]:
    """(V, 3) sRGB: the material's factor times its picture at each vertex."""
    if part.material < 0:
        return np.full((len(part.vertices), 3), 0.8)
    material = materials[part.material]
    factor = np.clip(np.array(material.colour[:3]), 0, 1)
    linear = np.tile(factor, (len(part.vertices), 1))
    if material.image is not None and part.texture_coordinates is not None:
        linear = linear * _picture_at(material.image, part.texture_coordinates)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def _picture_at(image: bytes, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V, 3) linear colours of an encoded picture at texture coordinates (V, 2), repeating; white where unreadable."""
    from PIL import Image, UnidentifiedImageError

    try:
        picture = np.asarray(Image.open(io.BytesIO(image)).convert("RGB"), float) / 255
    except (UnidentifiedImageError, OSError, ValueError):
        return np.ones((len(coordinates), 3))
    height, width = picture.shape[:2]
    column = np.minimum((np.mod(coordinates[:, 0], 1.0) * width).astype(int), width - 1)
    row = np.minimum((np.mod(coordinates[:, 1], 1.0) * height).astype(int), height - 1)
    encoded = picture[row, column]
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
