"""`NAME.examples.toml`: example shapes of a character, each a mesh with one joint bent.

    format = "sixpoint-examples 1"

    [[example]]
    mesh = "elbow_90.obj"
    joint = "left_lower_arm"
    turn_deg = [0.0, -90.0, 0.0]

`mesh` is a file beside this one with the character's vertices in the same order. `joint` is a humanoid bone or the
skeleton's own name. `turn_deg` is how far it is turned in that mesh: a rotation vector in degrees, its direction the
axis in the character file's own axes; without it the turn is found from the mesh. `pose` names further joints that are
turned there, which do not bring the shape in: `pose = { left_hand = [0.0, 0.0, 20.0] }`.
"""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.character import Character
from deformation.character_files import Placement
from deformation.deformer import Deformer, DeformSettings
from deformation.mesh_files import read_mesh
from deformation.pose_shapes import LEAST_TURN, ExampleShape, blended_turns
from deformation.skinning import joint_motion
from devices.errors import FileError
from devices.frame import frozen
from reconstruction.skeleton import Skeleton

FORMAT = "sixpoint-examples 1"

_OWN = 0.9
"""Vertices that hang on a joint by so much or more tell how it is turned."""

_FEWEST = 6
"""So many of them are needed."""

_KEYS = {"mesh", "joint", "turn_deg", "pose"}


def examples_beside(path: str | Path) -> Path | None:
    """The examples that lie beside a character's file as `NAME.examples.toml`, if any do."""
    path = Path(path)
    beside = path.with_name(path.stem + ".examples.toml")
    return beside if beside.is_file() else None


def with_examples(character: Character, path: str | Path, placement: Placement | None = None) -> Character:
    """The character with the example shapes of a file.

    placement: what was done to the vertices of the character's own file. Raises FileError naming the file, the
    example and what is wrong with it.
    """
    path = Path(path)
    plain = replace(character, examples=())
    deformer = Deformer(plain, DeformSettings(secondary=None))
    shapes: list[ExampleShape] = []
    for number, entry in enumerate(_entries(path), start=1):
        where = f"{path}: example {number}"
        shapes.append(_shape(plain, deformer, entry, path.parent, where, placement))
        for earlier in shapes[:-1]:
            if earlier.joint == shapes[-1].joint and np.linalg.norm(earlier.turn - shapes[-1].turn) < LEAST_TURN:
                name = character.skeleton.names[earlier.joint]
                raise FileError(f"{where}: an earlier example turns {name} by the same angle")
    return replace(character, examples=tuple(shapes))


def _entries(path: Path) -> list[dict[str, Any]]:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: not TOML ({error})") from None
    if content.get("format") != FORMAT:
        raise FileError(f'{path}: format is {content.get("format")!r} where "{FORMAT}" is needed')
    entries = content.get("example")
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        raise FileError(f"{path}: it holds no [[example]]")
    return entries


def _shape(
    character: Character,
    deformer: Deformer,
    entry: dict[str, Any],
    folder: Path,
    where: str,
    placement: Placement | None,
) -> ExampleShape:
    unknown = sorted(entry.keys() - _KEYS)
    if unknown:
        raise FileError(f"{where}: no key {unknown[0]!r}: there are {', '.join(sorted(_KEYS))}")
    joint = _joint(character.skeleton, entry.get("joint"), where)
    vertices = _vertices(character, entry.get("mesh"), folder, where, placement)
    axes = np.eye(3) if placement is None else _rotation(placement.turn)
    turns = {_joint(character.skeleton, name, where): _turn(t, axes, where) for name, t in _pose(entry, where).items()}
    turn = _turn(entry["turn_deg"], axes, where) if "turn_deg" in entry else found_turn(character, vertices, joint)
    if turn is None or np.linalg.norm(turn) < LEAST_TURN:
        raise FileError(
            f"{where}: {character.skeleton.names[joint]} is not bent in its mesh by a degree or more: "
            "say by how much with turn_deg"
        )
    joints = posed(character, turns | {joint: turn})
    deformer.reset()
    plain = deformer.deform(joints).vertices
    motion = joint_motion(joints, character.bind_inverse)
    turned = blended_turns(motion, character.vertex_joints, character.vertex_weights)
    return ExampleShape(joint, frozen(turn), frozen(np.linalg.solve(turned, (vertices - plain)[..., None])[..., 0]))


def posed(character: Character, turns: dict[int, NDArray[np.float64]]) -> NDArray[np.float64]:
    """(J, 4, 4) `T_world_joint` of the bind pose with some joints turned about where they stand.

    turns: rotation vectors (3,) radians by joint, in the world's axes of the bind pose.
    """
    motion = np.empty_like(character.bind)
    for joint, parent in enumerate(character.skeleton.parents):
        own, place = np.eye(4), character.bind[joint, :3, 3]
        if joint in turns:
            own[:3, :3] = Rotation.from_rotvec(turns[joint]).as_matrix()
            own[:3, 3] = place - own[:3, :3] @ place
        motion[joint] = own if parent < 0 else motion[parent] @ own
    return motion @ character.bind


def found_turn(character: Character, vertices: NDArray[np.float64], joint: int) -> NDArray[np.float64] | None:
    """(3,) radians: how a joint is turned against its parent in a pose of the mesh, by the best rigid motions of both.

    vertices: (V, 3) metres. None for the root and where too few vertices hang on one of the two.
    """
    parent = int(character.skeleton.parents[joint])
    if parent < 0:
        return None
    turns = []
    for number in (parent, joint):
        own = (character.vertex_weights * (character.vertex_joints == number)).sum(axis=1) >= _OWN
        if own.sum() < _FEWEST:
            return None
        before, after = character.mesh.vertices[own], vertices[own]
        turns.append(Rotation.align_vectors(after - after.mean(axis=0), before - before.mean(axis=0))[0])
    return (turns[0].inv() * turns[1]).as_rotvec()


def _vertices(
    character: Character, name: object, folder: Path, where: str, placement: Placement | None
) -> NDArray[np.float64]:
    if not isinstance(name, str) or not name:
        raise FileError(f"{where}: mesh is not the name of a file")
    vertices = read_mesh(folder / name).vertices
    needed = len(character.mesh.vertices) if placement is None else placement.count
    if len(vertices) != needed:
        raise FileError(
            f"{where}: {name} has {len(vertices)} vertices where the character's file has {needed}: "
            "export both from one mesh"
        )
    return vertices if placement is None else placement.placed(vertices)


def _joint(skeleton: Skeleton, name: object, where: str) -> int:
    if name in skeleton.names:
        return skeleton.names.index(name)
    if isinstance(name, str) and name in skeleton.humanoid:
        return skeleton.humanoid[name]
    raise FileError(f"{where}: no joint {name!r}: there are {', '.join(skeleton.names)}")


def _pose(entry: dict[str, Any], where: str) -> dict[str, Any]:
    pose = entry.get("pose", {})
    if not isinstance(pose, dict):
        raise FileError(f"{where}: pose is not a table of joints and their turns")
    return pose


def _turn(value: object, axes: NDArray[np.float64], where: str) -> NDArray[np.float64]:
    try:
        turn = np.radians(np.array(value, float).reshape(3))
    except (TypeError, ValueError):
        turn = np.full(3, np.nan)
    if not np.linalg.norm(turn) <= np.pi * (1 + 1e-9):
        raise FileError(f"{where}: a turn is three numbers of degrees, 180 at most together, not {value!r}")
    return turn @ axes


def _rotation(turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) a turn without its scale."""
    return turn / np.cbrt(np.linalg.det(turn))
