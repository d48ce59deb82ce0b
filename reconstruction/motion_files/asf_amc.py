"""Acclaim skeletons (ASF) and motions (AMC), as the CMU motion capture database has them.

Source of the format: M. Meredith and S. Maddock, "Motion Capture File Formats Explained", University of Sheffield
CS-01-11 (2001), section 2.4, and J. Lander, "Working with motion capture file formats", Game Developer (1998). A bone
turns about its start, in axes C of its own: its local rotation is `C M C^-1`, M made of the motion's angles about the
fixed axes in the order of the bone's degrees of freedom.
"""

from dataclasses import dataclass, field
from itertools import product
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.errors import FileError
from devices.frame import frozen
from reconstruction.motion import Motion
from reconstruction.motion_operations import continuous_hemispheres
from reconstruction.skeleton import Skeleton

INCH_M = 0.0254
CMU_FPS = 120.0
"""Frames a second where nothing else is said: AMC files do not hold it."""


@dataclass
class _Bone:
    """A bone of an ASF file. direction: unit vector, length: metres, axis: R_world_bone C at rest."""

    name: str
    direction: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis: Rotation = field(default_factory=Rotation.identity)
    channels: tuple[str, ...] = ()
    limits: tuple[tuple[float, float], ...] = ()

    @property
    def turns(self) -> str:
        """The axes that it turns about, in order, as `Rotation.from_euler` names fixed axes: `xyz`."""
        return "".join(channel[1] for channel in self.channels if channel[0] == "r")


@dataclass(frozen=True)
class AcclaimSkeleton:
    """What an ASF file describes: the skeleton, and how the columns of its AMC files turn it.

    bones: by name, the root under `root`; position_unit_m: metres a unit of the AMC's root position.
    """

    skeleton: Skeleton
    bones: dict[str, _Bone]
    position_unit_m: float


def read_asf(path: str | Path) -> AcclaimSkeleton:
    """The skeleton of an ASF file, lengths in metres: its unit is 1/`length` inches (CMU's 0.45: 56.4 mm).

    Joints are named after the bones that turn about them; a bone that nothing hangs on ends in `<bone>_end`. The
    file's limits on angles become an outer box of limits on each joint's rotation vector. Raises FileError.
    """
    path = Path(path)
    sections = _sections(path)
    for needed in (":units", ":root", ":bonedata", ":hierarchy"):
        if needed not in sections:
            raise FileError(f"{path}: no {needed} section; the file is cut off or not an ASF file")
    unit_m, angle = _units(path, sections[":units"])
    bones = {"root": _root(path, sections[":root"], angle)}
    for lines in _blocks(path, sections[":bonedata"]):
        bone = _bone(path, lines, unit_m, angle)
        bones[bone.name] = bone
    return AcclaimSkeleton(_skeleton(path, bones, _parents(path, sections[":hierarchy"], bones)), bones, unit_m)


def read_amc(path: str | Path, asf: str | Path | None = None, fps: float = CMU_FPS) -> Motion:
    """The motion of an AMC file on the skeleton of its ASF file.

    asf: where None, the file beside it that CMU's names point to (`01.asf` for `01_01.amc`), one of the same stem, or
    the only one in the folder. fps: frames a second, which the format does not hold. Raises FileError.
    """
    path = Path(path)
    acclaim = read_asf(asf if asf is not None else _asf_beside(path))
    values, in_degrees = _frames(path, acclaim.bones)
    skeleton, bones = acclaim.skeleton, acclaim.bones
    frames = len(values["root"])
    rotations = np.zeros((frames, len(skeleton), 4))
    rotations[..., 3] = 1
    for name, columns in values.items():
        bone = bones[name]
        if bone.turns:
            angles = columns[:, [k for k, channel in enumerate(bone.channels) if channel[0] == "r"]]
            motion = Rotation.from_euler(bone.turns, angles, degrees=in_degrees)
            rotations[:, skeleton.names.index(name)] = (bone.axis * motion * bone.axis.inv()).as_quat()
    positions = np.zeros((frames, 3))
    for k, channel in enumerate(bones["root"].channels):
        if channel[0] == "t":
            positions[:, "xyz".index(channel[1])] = values["root"][:, k] * acclaim.position_unit_m
    return Motion(
        skeleton, frozen(positions + skeleton.offsets[0]), frozen(continuous_hemispheres(rotations)), fps, path.stem
    )


_Lines = list[tuple[int, list[str]]]
"""Numbered lines, as words."""


def _numbered_words(path: Path) -> _Lines:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}") from error
    if not text.strip():
        raise FileError(f"{path}: the file is empty")
    lines = ((number, line.partition("#")[0].split()) for number, line in enumerate(text.splitlines(), 1))
    return [(number, words) for number, words in lines if words]


def _sections(path: Path) -> dict[str, _Lines]:
    sections: dict[str, _Lines] = {}
    current: _Lines = []
    for number, words in _numbered_words(path):
        if words[0].startswith(":"):
            current = sections.setdefault(words[0].lower(), [])
        else:
            current.append((number, words))
    return sections


def _numbers(path: Path, number: int, words: list[str], count: int) -> NDArray[np.float64]:
    """As many finite numbers as asked for, from words such as `(-10.0` and `170)`."""
    try:
        values = np.array([float(word.strip("(),")) for word in words])
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values[np.abs(values) < np.inf]).all() or np.isnan(values).any():
        raise FileError(f"{path}:{number}: {count} numbers are needed, not {' '.join(words)[:60]!r}")
    return values


def _units(path: Path, lines: _Lines) -> tuple[float, float]:
    """Metres a unit of length, and radians a unit of angle."""
    unit_m, angle = INCH_M, np.pi / 180
    for number, words in lines:
        if words[0] == "length":
            unit_m = INCH_M / float(_numbers(path, number, words[1:], 1)[0])
        elif words[0] == "angle":
            angle = 1.0 if words[1:] and words[1].lower().startswith("rad") else np.pi / 180
    return unit_m, angle


def _root(path: Path, lines: _Lines, angle: float) -> _Bone:
    root, order, turns = _Bone("root"), "xyz", np.zeros(3)
    for number, words in lines:
        if words[0] == "order":
            root.channels = tuple(word.lower() for word in words[1:])
        elif words[0] == "axis":
            order = words[1].lower()
        elif words[0] == "position":
            root.direction, root.length = _numbers(path, number, words[1:], 3), 1.0
        elif words[0] == "orientation":
            turns = _numbers(path, number, words[1:], 3) * angle
    root.axis = Rotation.from_euler(order, turns)
    return root


def _blocks(path: Path, lines: _Lines) -> list[_Lines]:
    """The lines between each `begin` and `end`."""
    blocks: list[_Lines] = []
    inside = False
    for number, words in lines:
        if words[0] == "begin":
            blocks.append([])
            inside = True
        elif words[0] == "end":
            inside = False
        elif inside:
            blocks[-1].append((number, words))
        else:
            raise FileError(f"{path}:{number}: {words[0]!r} stands outside of a begin ... end block")
    if inside:
        raise FileError(f"{path}: a block begins and does not end; the file is cut off")
    return blocks


def _bone(path: Path, lines: _Lines, unit_m: float, angle: float) -> _Bone:
    bone = _Bone("")
    limits: list[tuple[float, float]] = []
    in_limits = False
    for number, words in lines:
        in_limits = words[0] == "limits" or (in_limits and words[0].startswith("("))
        if in_limits:
            low, high = _numbers(path, number, words[1:] if words[0] == "limits" else words, 2) * angle
            limits.append((low, high))
        elif words[0] == "name":
            bone.name = words[1] if len(words) > 1 else ""
        elif words[0] == "direction":
            direction = _numbers(path, number, words[1:], 3)
            bone.direction = direction / max(float(np.linalg.norm(direction)), 1e-12)
        elif words[0] == "length":
            bone.length = float(_numbers(path, number, words[1:], 1)[0]) * unit_m
        elif words[0] == "axis":
            bone.axis = Rotation.from_euler(words[-1].lower(), _numbers(path, number, words[1:4], 3) * angle)
        elif words[0] == "dof":
            bone.channels = tuple(word.lower() for word in words[1:])
    if not bone.name:
        raise FileError(f"{path}:{lines[0][0] if lines else 0}: a bone without a name")
    bone.limits = tuple(limits)
    return bone


def _parents(path: Path, lines: _Lines, bones: dict[str, _Bone]) -> dict[str, str]:
    """Parent's name by bone name, from lines `parent child child ...`; parents stand before their children."""
    parents: dict[str, str] = {}
    for number, words in lines:
        if words[0] in ("begin", "end"):
            continue
        unknown = [word for word in words if word not in bones]
        if unknown:
            raise FileError(f"{path}:{number}: bone {unknown[0]!r} is not in :bonedata")
        if words[0] != "root" and words[0] not in parents:
            raise FileError(f"{path}:{number}: bone {words[0]!r} has children before it has a parent")
        parents.update(dict.fromkeys(words[1:], words[0]))
    if not parents:
        raise FileError(f"{path}: the :hierarchy section is empty; the file is cut off")
    return parents


def _skeleton(path: Path, bones: dict[str, _Bone], parents: dict[str, str]) -> Skeleton:
    names: list[str] = ["root", *parents]
    tails = [name for name in parents if name not in parents.values() and bones[name].length > 0]
    parent_of = {**parents, **{f"{tail}_end": tail for tail in tails}}
    names += [f"{tail}_end" for tail in tails]

    def tail_of(name: str) -> NDArray[np.float64]:
        return bones[name].direction * bones[name].length if name != "root" else np.zeros(3)

    offsets = [bones["root"].direction * bones["root"].length, *(tail_of(parent_of[name]) for name in names[1:])]
    indices = [-1, *(names.index(parent_of[name]) for name in names[1:])]
    limits = np.stack([_limits(bones[name]) if name in bones else np.zeros((3, 2)) for name in names])
    return Skeleton(tuple(names), frozen(np.array(indices, np.int32)), frozen(np.array(offsets)), frozen(limits))


def _limits(bone: _Bone) -> NDArray[np.float64]:
    """(3, 2) the box of rotation vectors that the bone's limited angles can make; +-pi where it has no limits."""
    turns = bone.turns
    if bone.name == "root" or (turns and len(bone.limits) != len(bone.channels)):
        return np.array([[-np.pi, np.pi]] * 3)
    if not turns:
        return np.zeros((3, 2))
    ranges = [limit for limit, channel in zip(bone.limits, bone.channels, strict=True) if channel[0] == "r"]
    grid = np.array(list(product(*(np.linspace(low, high, 7) for low, high in np.clip(ranges, -np.pi, np.pi)))))
    vectors = (bone.axis * Rotation.from_euler(turns, grid) * bone.axis.inv()).as_rotvec()
    return np.stack([vectors.min(axis=0), vectors.max(axis=0)], axis=-1)


def _asf_beside(path: Path) -> Path:
    """The ASF file that belongs to an AMC file."""
    folder = path.parent
    for stem in (path.stem, path.stem.rpartition("_")[0]):
        candidate = folder / f"{stem}.asf"
        if stem and candidate.is_file():
            return candidate
    only = sorted(folder.glob("*.asf"))
    if len(only) == 1:
        return only[0]
    raise FileError(
        f"{path}: no skeleton beside it; put {path.stem.rpartition('_')[0] or path.stem}.asf into its folder"
    )


def _frames(path: Path, bones: dict[str, _Bone]) -> tuple[dict[str, NDArray[np.float64]], bool]:
    """By bone its columns (T, channels) as the file has them, and whether angles are in degrees."""
    rows: dict[str, list[list[float]]] = {}
    in_degrees, frames = True, 0
    lines = _numbered_words(path)
    for number, words in lines:
        name = words[0]
        if name.startswith(":"):
            in_degrees = False if name.upper() == ":RADIANS" else in_degrees
        elif len(words) == 1 and name.isdigit():
            _check_complete(path, number, rows, frames)
            frames += 1
        elif name not in bones:
            raise FileError(f"{path}:{number}: bone {name!r} is not in the skeleton file")
        else:
            rows.setdefault(name, []).append(_row(path, number, words, len(bones[name].channels)))
    _check_complete(path, lines[-1][0], rows, frames)
    if not frames or "root" not in rows:
        raise FileError(f"{path}: holds no frames; the file is cut off or not an AMC file")
    return {name: np.array(values) for name, values in rows.items()}, in_degrees


def _row(path: Path, number: int, words: list[str], width: int) -> list[float]:
    if len(words) - 1 != width:
        raise FileError(f"{path}:{number}: {len(words) - 1} values for {words[0]!r}, which has {width}")
    try:
        values = [float(word) for word in words[1:]]
    except ValueError as error:
        raise FileError(f"{path}:{number}: {error}") from None
    if not all(map(isfinite, values)):
        raise FileError(f"{path}:{number}: a value is NaN or infinite; every value must be a finite number")
    return values


def _check_complete(path: Path, number: int, rows: dict[str, list[list[float]]], frames: int) -> None:
    """Every bone has one row a frame so far."""
    for name, values in rows.items():
        if len(values) != frames:
            raise FileError(f"{path}:{number}: bone {name!r} stands {len(values)} times in {frames} frames")
