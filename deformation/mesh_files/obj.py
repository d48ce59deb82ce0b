"""Wavefront OBJ in: positions and faces; texture coordinates, normals, groups and materials are passed over."""

import math
from pathlib import Path

import numpy as np

from deformation.mesh import Mesh
from deformation.mesh_files.faces import mesh_of_faces
from devices.errors import FileError


def read_obj(path: Path) -> Mesh:
    """The mesh of an OBJ file, quads kept, larger faces fanned. Raises FileError with the line."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    for number, line in enumerate(_joined(lines), start=1):
        words = line.split("#", 1)[0].split()
        if not words or words[0] not in ("v", "f"):
            continue
        try:
            if words[0] == "v":
                vertices.append(_position(words[1:]))
            else:
                faces.append(_corners(words[1:], len(vertices)))
        except ValueError as error:
            raise FileError(f"{path}, line {number}: {error}") from None
    if not vertices:
        raise FileError(f"{path}: it has no 'v' lines; an OBJ mesh needs vertices and faces")
    _check_forward_references(path, lines, faces, len(vertices))
    return mesh_of_faces(np.array(vertices), faces)


def _joined(lines: list[str]) -> list[str]:
    """A line that ends in a backslash goes on in the next; blanks keep the numbering."""
    result = list(lines)
    for i in range(len(result) - 2, -1, -1):
        if result[i].endswith("\\"):
            result[i] = result[i][:-1] + " " + result[i + 1]
            result[i + 1] = ""
    return result


def _position(words: list[str]) -> list[float]:
    try:
        position = [float(word) for word in words[:3]]
    except ValueError:
        raise ValueError(f"a vertex needs three numbers, not {' '.join(words)!r}") from None
    if len(position) < 3 or not all(map(math.isfinite, position)):
        raise ValueError(f"a vertex needs three finite numbers, not {' '.join(words)!r}")
    return position


def _corners(words: list[str], so_far: int) -> list[int]:
    """Vertex indices from 0 of `7`, `7/1`, `7//3`, `7/1/3` or `-1`, the last one so far."""
    if len(words) < 3:
        raise ValueError(f"a face needs at least three corners, not {' '.join(words)!r}")
    corners = []
    for word in words:
        try:
            index = int(word.split("/", 1)[0])
        except ValueError:
            raise ValueError(f"{word!r} is no face corner: use a vertex number such as 7 or 7/1/3") from None
        if index == 0 or -index > so_far:
            raise ValueError(f"vertex {index} does not exist: numbers run from 1, or back from -1 to -{so_far}")
        corners.append(index - 1 if index > 0 else so_far + index)
    return corners


def _check_forward_references(path: Path, lines: list[str], faces: list[list[int]], count: int) -> None:
    """A face may name a vertex that comes later in the file, but not one that never comes."""
    if not faces or max(map(max, faces)) < count:
        return
    bad = next(i for i, face in enumerate(faces) if max(face) >= count)
    numbers = [n for n, line in enumerate(lines, start=1) if line.split("#", 1)[0].split()[:1] == ["f"]]
    raise FileError(f"{path}, line {numbers[bad]}: vertex {max(faces[bad]) + 1} does not exist: the file has {count}")
