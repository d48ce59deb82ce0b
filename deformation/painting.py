"""A character's weights and softness as a user painted them: saved to a file, laid over a bound character.

The file is a NumPy archive (`.npz`): `softness` (V,) 0 to 1, and `joints` (names) with `weights` (V, len(joints)).
Either may be missing; a vertex whose painted weights are all zero keeps its own.
"""

import os
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deformation.character import Character, LatticeSettings, make_character, with_softness
from devices.errors import FileError


def dense_weights(character: Character) -> NDArray[np.float64]:
    """(V, J) the weights of every vertex."""
    weights = np.zeros((len(character.mesh.vertices), len(character.skeleton)))
    for place in range(character.vertex_joints.shape[1]):
        rows = np.arange(len(weights))
        weights[rows, character.vertex_joints[:, place]] += character.vertex_weights[:, place]
    return weights


def vertex_softness(character: Character) -> NDArray[np.float64]:
    """(V,) how soft the flesh is under every vertex."""
    corners = character.lattice.cells[character.lattice.vertex_cells]
    return (character.softness[corners] * character.lattice.vertex_weights).sum(axis=1)


def save_painting(character: Character, path: str | Path) -> None:
    """Writes a character's weights and softness, to be painted over, beside the path and renamed into place."""
    path = Path(path)
    partial = path.with_name(f".{path.name}.partial")
    try:
        with partial.open("wb") as file:
            np.savez_compressed(
                file,
                softness=vertex_softness(character).astype(np.float32),
                joints=np.array(character.skeleton.names),
                weights=dense_weights(character).astype(np.float32),
            )
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def painted(character: Character, path: str | Path) -> Character:
    """The character with the weights and the softness of a painting. Raises FileError where they do not fit it."""
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
            layers = {name: data[name] for name in data.files}
    except FileNotFoundError as error:
        raise FileError(f"{path}: no such file") from error
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FileError(f"{path}: not a NumPy archive of a painting ({error})") from error
    if not layers.keys() & {"softness", "weights"}:
        raise FileError(f"{path}: holds neither `softness` nor `weights`")
    softness = _of_vertices(layers, "softness", character, path)
    if "weights" in layers:
        weights = _weights(layers, character, path)
        kept = LatticeSettings(cell_size_m=character.lattice.cell_size)
        character = make_character(
            character.mesh, character.skeleton, character.bind, character.name, kept, vertex_weights=weights
        )
    return character if softness is None else with_softness(character, softness)


def _of_vertices(
    layers: dict[str, NDArray], name: str, character: Character, path: str | Path
) -> NDArray[np.float64] | None:
    if name not in layers:
        return None
    values, count = np.asarray(layers[name]), len(character.mesh.vertices)
    if (
        values.shape[:1] != (count,)
        or values.dtype.kind not in "fiu"
        or not (np.isfinite(values) & (values >= 0)).all()
    ):
        raise FileError(f"{path}: `{name}` must be numbers from 0 up, one row for each of the {count} vertices")
    return values.astype(np.float64)


def _weights(layers: dict[str, NDArray], character: Character, path: str | Path) -> NDArray[np.float64]:
    values = _of_vertices(layers, "weights", character, path)
    names = [str(name) for name in layers.get("joints", ())]
    if values is None or values.ndim != 2 or values.shape[1] != len(names):
        raise FileError(f"{path}: `weights` needs one column for each name in `joints`")
    unknown = sorted(set(names) - set(character.skeleton.names))
    if unknown:
        raise FileError(f"{path}: no joint {unknown[0]!r}: the skeleton has {', '.join(character.skeleton.names)}")
    weights = np.zeros((len(values), len(character.skeleton)))
    weights[:, [character.skeleton.names.index(name) for name in names]] = values
    bare = weights.sum(axis=1) <= 0
    weights[bare] = dense_weights(character)[bare]
    return weights / weights.sum(axis=1, keepdims=True)
