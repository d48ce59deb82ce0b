"""What a user decides of a character: weights, softness, region half-widths and parts, by vertex or by bone.

A painting by vertex is a NumPy archive (`.npz`), one by bone a text (`.toml`); docs/file_formats.md has their layout.
Whatever a painting leaves open is found as without one.
"""

import tomllib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deformation.shape_matching import WIDEST
from devices.errors import FileError, choice_error
from devices.frame import frozen
from reconstruction.skeleton import Skeleton
from replay_logs.atomic_file import written_beside

MOST_BONE_FACTOR = 10.0
"""The largest factor on a bone's width or strength; the smallest is its inverse."""


@dataclass(frozen=True, eq=False)
class Painting:
    """What is painted, each None where nothing is.

    On the vertices: weights: (V, J), a row sums to 1, or to 0 where it is left open. softness: (V,) 0 to 1, NaN where
    open. half_widths: (V,) 1 to 5, 0 where open. bone_parts, joint_parts: (V,) the joint whose part each vertex is in,
    -1 where open (fig. 5a and 5b).
    By joint: bone_softness: (J,) 0 to 1, NaN where open. bone_half_widths: (J,) 1 to 5, 0 where open. bone_widths,
    bone_strengths: (J,) factors. counted_to: (J,) the joint whose joint-dependent part each joint's is counted to.
    """

    weights: NDArray[np.float64] | None = None
    softness: NDArray[np.float64] | None = None
    half_widths: NDArray[np.int32] | None = None
    bone_parts: NDArray[np.int32] | None = None
    joint_parts: NDArray[np.int32] | None = None
    bone_softness: NDArray[np.float64] | None = None
    bone_half_widths: NDArray[np.int32] | None = None
    bone_widths: NDArray[np.float64] | None = None
    bone_strengths: NDArray[np.float64] | None = None
    counted_to: NDArray[np.int32] | None = None

    def over(self, under: "Painting") -> "Painting":
        """This painting, and what it has nothing of from the one under it. A row of weights left open stays open."""
        names = [field.name for field in fields(self)]
        own = {name: getattr(self, name) for name in names}
        merged = {name: getattr(under, name) if own[name] is None else own[name] for name in names}
        if self.weights is not None and under.weights is not None:
            bare = self.weights.sum(axis=1) <= 0
            merged["weights"] = frozen(np.where(bare[:, None], under.weights, self.weights))
        return Painting(**merged)


UNPAINTED = Painting()


def read_painting(path: str | Path, skeleton: Skeleton, vertices: int) -> Painting:
    """The painting in a file, for a mesh of so many vertices. Raises FileError where it does not fit them."""
    path = Path(path)
    if not path.is_file():
        raise FileError(f"{path}: no such file")
    if path.suffix.lower() == ".toml":
        return _by_bone(path, skeleton)
    return _by_vertex(path, skeleton, vertices)


def painting_beside(character: str | Path) -> Path | None:
    """The painting that lies beside a character's file, `NAME.painting.npz` or `NAME.painting.toml`, if any does."""
    path = Path(character)
    beside = [path.with_name(f"{path.stem}.painting{ending}") for ending in (".npz", ".toml")]
    return next((file for file in beside if file.is_file()), None)


def write_painting(painting: Painting, skeleton: Skeleton, path: str | Path) -> None:
    """Writes what is painted by vertex as `.npz`, or what is by joint as `.toml`, beside the path and then in place.

    Raises FileError for another ending.
    """
    path = Path(path)
    if path.suffix.lower() not in (".npz", ".toml"):
        raise FileError(f"{path}: a painting ends in .npz (by vertex) or .toml (by bone)")
    with written_beside(path) as part:
        if path.suffix.lower() == ".toml":
            part.write_text(_toml(painting, skeleton), encoding="utf-8")
        else:
            np.savez_compressed(part, **_layers(painting, skeleton))  # type: ignore[arg-type]


def _layers(painting: Painting, skeleton: Skeleton) -> dict[str, NDArray]:
    layers: dict[str, NDArray] = {"joints": np.array(skeleton.names)}
    for name, field, kind in _VERTEX_LAYERS:
        values = getattr(painting, field)
        if values is not None:
            layers[name] = values.astype(kind)
    return layers


_VERTEX_LAYERS = (
    ("weights", "weights", np.float32),
    ("softness", "softness", np.float32),
    ("half_width", "half_widths", np.int8),
    ("bone_part", "bone_parts", np.int16),
    ("joint_part", "joint_parts", np.int16),
)
"""Name in the archive, field of `Painting`, type in the archive."""


def _by_vertex(path: Path, skeleton: Skeleton, vertices: int) -> Painting:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            layers = {name: data[name] for name in data.files}
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: not a NumPy archive of a painting ({error})") from error
    known = [name for name, _, _ in _VERTEX_LAYERS]
    if not layers.keys() & set(known):
        raise FileError(f"{path}: holds none of {', '.join(f'`{name}`' for name in known)}")
    joints = _named_joints(layers.get("joints", np.array([], str)), skeleton, path)
    softness = _numbers(layers, "softness", path, vertices, 0, 1)
    half_widths = _numbers(layers, "half_width", path, vertices, 0, WIDEST)
    return Painting(
        _weights(layers, joints, skeleton, path, vertices),
        softness,
        None if half_widths is None else frozen(half_widths.astype(np.int32)),
        _part(layers, "bone_part", joints, path, vertices),
        _part(layers, "joint_part", joints, path, vertices),
    )


def _numbers(
    layers: Mapping[str, NDArray], name: str, path: Path, vertices: int, low: float, high: float
) -> NDArray[np.float64] | None:
    if name not in layers:
        return None
    values = np.asarray(layers[name])
    fits = values.shape[:1] == (vertices,) and values.dtype.kind in "fiu"
    if not fits or not ((values >= low) & (values <= high)).all():
        raise FileError(
            f"{path}: `{name}` must be numbers from {low:g} to {high:g}, one row for each of the {vertices} vertices"
        )
    return frozen(values.astype(np.float64))


def _weights(
    layers: Mapping[str, NDArray], joints: list[int], skeleton: Skeleton, path: Path, vertices: int
) -> NDArray[np.float64] | None:
    values = _numbers(layers, "weights", path, vertices, 0, np.inf)
    if values is None:
        return None
    if values.ndim != 2 or values.shape[1] != len(joints) or not np.isfinite(values).all():
        raise FileError(f"{path}: `weights` needs one column of numbers for each name in `joints`")
    weights = np.zeros((vertices, len(skeleton)))
    weights[:, joints] = values
    total = weights.sum(axis=1, keepdims=True)
    return frozen(np.divide(weights, total, out=np.zeros_like(weights), where=total > 0))


def _part(
    layers: Mapping[str, NDArray], name: str, joints: list[int], path: Path, vertices: int
) -> NDArray[np.int32] | None:
    values = _numbers(layers, name, path, vertices, -1, len(joints) - 1)
    return None if values is None else frozen(np.array([*joints, -1], np.int32)[values.astype(np.int64)])


def _named_joints(names: NDArray, skeleton: Skeleton, path: Path) -> list[int]:
    return [_joint(str(name), skeleton, path) for name in names]


def _joint(name: str, skeleton: Skeleton, path: Path) -> int:
    """A joint by its own name or by the humanoid bone that it is."""
    if name in skeleton.names:
        return skeleton.names.index(name)
    if name in skeleton.humanoid:
        return skeleton.humanoid[name]
    raise FileError(f"{path}: no joint {name!r}: the skeleton has {', '.join(skeleton.names)}")


_BONE_SECTIONS = {
    "softness": ("bone_softness", 0.0, 1.0, np.nan, np.float64),
    "half_width": ("bone_half_widths", 1, WIDEST, 0, np.int32),
    "bone_width": ("bone_widths", 1 / MOST_BONE_FACTOR, MOST_BONE_FACTOR, 1.0, np.float64),
    "bone_strength": ("bone_strengths", 1 / MOST_BONE_FACTOR, MOST_BONE_FACTOR, 1.0, np.float64),
}
"""Section of the text: field of `Painting`, lowest and highest value, what stands where nothing is said, type."""


def _by_bone(path: Path, skeleton: Skeleton) -> Painting:
    try:
        sections = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: not TOML: {error}") from None
    found: dict[str, NDArray] = {}
    for section, values in sections.items():
        if section not in (*_BONE_SECTIONS, "parts") or not isinstance(values, dict):
            raise FileError(f"{path}: {choice_error('section', section, (*_BONE_SECTIONS, 'parts'))}")
        if section == "parts":
            found["counted_to"] = _counted_to(values, skeleton, path)
        else:
            field, low, high, otherwise, kind = _BONE_SECTIONS[section]
            found[field] = frozen(_of_joints(values, skeleton, path, section, (low, high, otherwise)).astype(kind))
    return Painting(**found)


def _of_joints(
    values: Mapping[str, object], skeleton: Skeleton, path: Path, section: str, bounds: tuple[float, float, float]
) -> NDArray[np.float64]:
    low, high, otherwise = bounds
    result = np.full(len(skeleton), otherwise)
    for name, value in values.items():
        joint = _joint(name, skeleton, path)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise FileError(f"{path}: {section}.{name}: a number from {low:g} to {high:g}, not {value!r}")
        result[joint] = value
    return result


def _counted_to(values: Mapping[str, object], skeleton: Skeleton, path: Path) -> NDArray[np.int32]:
    """(J,) whose part each joint's is counted to; a joint may be named that is itself counted to another."""
    goal = np.arange(len(skeleton), dtype=np.int32)
    for name, value in values.items():
        goal[_joint(name, skeleton, path)] = _joint(str(value), skeleton, path)
    last = goal.copy()
    for _ in range(len(skeleton)):
        last = goal[last]
    if (goal[last] != last).any():
        raise FileError(f"{path}: parts: {', '.join(values)} are counted to each other in a circle")
    return frozen(last)


def _toml(painting: Painting, skeleton: Skeleton) -> str:
    import tomlkit

    document = tomlkit.document()
    for section, (field, *_) in _BONE_SECTIONS.items():
        values = getattr(painting, field)
        if values is not None:
            document[section] = {
                name: round(float(v), 4) if values.dtype.kind == "f" else int(v)
                for name, v in zip(skeleton.names, values, strict=True)
                if np.isfinite(v) and not (field == "bone_half_widths" and v == 0)
            }
    if painting.counted_to is not None:
        moved = np.flatnonzero(painting.counted_to != np.arange(len(skeleton)))
        document["parts"] = {skeleton.names[j]: skeleton.names[painting.counted_to[j]] for j in moved}
    return tomlkit.dumps(document)
