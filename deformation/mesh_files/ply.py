"""Stanford PLY in (G. Turk 1994): positions and faces, as text or bytes; other properties are passed over."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deformation.mesh import Mesh
from deformation.mesh_files.faces import mesh_of_faces
from devices.errors import FileError

_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class _Property:
    """One property. kind: of its values; count_kind: of the length before a list's values, None for one value."""

    name: str
    kind: str
    count_kind: str | None = None


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def read_ply(path: Path) -> Mesh:
    """The mesh of a PLY file, quads kept, larger faces fanned. Raises FileError saying what is missing."""
    data = path.read_bytes()
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0 or b"\n" not in data[end:]:
        raise FileError(f"{path}: no PLY header from 'ply' to 'end_header'; the file is cut off or not PLY")
    order, elements = _header(path, data[:end].decode("ascii", "replace").splitlines())
    body = data[data.index(b"\n", end) + 1 :]
    try:
        values = _Values(body, order)
        tables = {element.name: [_row(element, values) for _ in range(element.count)] for element in elements}
    except (IndexError, ValueError):
        raise FileError(f"{path}: its data ends before the rows that its header names; the file is cut off") from None
    return _mesh(path, {element.name: element for element in elements}, tables)


def _header(path: Path, lines: list[str]) -> tuple[str, list[_Element]]:
    order, elements = None, []
    for number, line in enumerate(lines, start=1):
        match line.split():
            case ["format", kind, _]:
                if kind not in _BYTE_ORDERS:
                    raise FileError(f"{path}, line {number}: unknown format {kind!r}: use {', '.join(_BYTE_ORDERS)}")
                order = _BYTE_ORDERS[kind]
            case ["element", name, count] if count.isdigit():
                elements.append(_Element(name, int(count)))
            case ["property", "list", count_kind, kind, name] if elements and {count_kind, kind} <= _TYPES.keys():
                elements[-1].properties.append(_Property(name, kind, count_kind))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append(_Property(name, kind))
            case ["ply"] | ["comment", *_] | ["obj_info", *_] | []:
                pass
            case _:
                raise FileError(f"{path}, line {number}: {line.strip()!r} is no line of a PLY header")
    if order is None:
        raise FileError(f"{path}: its header has no format line: use {', '.join(_BYTE_ORDERS)}")
    return order, elements


class _Values:
    """A PLY file's values one after the other. Raises IndexError or ValueError at their end."""

    def __init__(self, body: bytes, order: str) -> None:
        words = body.split() if order == "" else []
        self._at = 0

        def from_text(kind: str, count: int) -> list[float]:
            taken = [float(word) for word in words[self._at : self._at + count]]
            self._at += count
            if len(taken) < count:
                raise IndexError
            return taken

        def from_bytes(kind: str, count: int) -> list[float]:
            values = np.frombuffer(body, order + _TYPES[kind], count, self._at)
            self._at += values.nbytes
            return values.tolist()

        self.take: Callable[[str, int], list[float]] = from_text if order == "" else from_bytes


def _row(element: _Element, values: _Values) -> dict[str, list[float]]:
    row = {}
    for prop in element.properties:
        count = 1 if prop.count_kind is None else int(values.take(prop.count_kind, 1)[0])
        row[prop.name] = values.take(prop.kind, count) if count else []
    return row


def _mesh(path: Path, elements: dict[str, _Element], tables: dict[str, list[dict[str, list[float]]]]) -> Mesh:
    vertex, face = (elements.get(name, _Element(name, 0)) for name in ("vertex", "face"))
    if not {"x", "y", "z"} <= {prop.name for prop in vertex.properties}:
        raise FileError(f"{path}: its vertices need the properties x, y and z")
    corners = next((p.name for p in face.properties if p.name in ("vertex_indices", "vertex_index")), None)
    if corners is None:
        raise FileError(f"{path}: its faces need a list property vertex_indices")
    positions: NDArray[np.float64] = np.array([[r["x"][0], r["y"][0], r["z"][0]] for r in tables["vertex"]], float)
    faces = [[int(corner) for corner in row[corners]] for row in tables["face"]]
    for number, indices in enumerate(faces, start=1):
        bad = next((i for i in indices if not 0 <= i < len(positions)), None)
        if bad is not None:
            raise FileError(f"{path}: face {number} names vertex {bad}: the file has 0 to {len(positions) - 1}")
    if not np.isfinite(positions).all():
        raise FileError(f"{path}: a vertex has a position that is no finite number")
    return mesh_of_faces(positions, faces)
