"""Mesh files: what is kept, and what a broken file is told."""

from pathlib import Path

import numpy as np
import pytest

from deformation.mesh import euler_characteristic, is_closed, volume
from deformation.mesh_files import read_mesh
from devices.errors import FileError

_MESHES = Path(__file__).parents[2] / ".." / "shared" / "meshes"

_CUBE = """# a cube
v 0 0 0
v 0 0 1
v 0 1 0
v 0 1 1
v 1 0 0
v 1 0 1
v 1 1 0 1.0
v 1 1 1
vt 0 0
vn 0 0 1
f 1/1/1 2/1/1 4/1/1 3/1/1
f 5//1 7//1 8//1 6//1
f 1/1 5/1 6/1 2/1
f -6 -5 -1 -2
f 1 3 7 5
f 2 6 8 \\
 4
"""


def _written(folder: Path, text: str, name: str = "mesh.obj") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_obj_of_every_corner_form(tmp_path: Path):
    mesh = read_mesh(_written(tmp_path, _CUBE))
    assert len(mesh.quads) == 6
    assert is_closed(mesh)
    assert volume(mesh) == pytest.approx(1.0)


def test_obj_fans_large_faces(tmp_path: Path):
    mesh = read_mesh(_written(tmp_path, "v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 1 0\nf 1 2 3 4 5\n"))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]


def test_obj_faces_may_stand_before_their_vertices(tmp_path: Path):
    assert len(read_mesh(_written(tmp_path, "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n")).triangles) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0\nf 1 1 1\n", "line 1: a vertex needs three"),
        ("v 0 0 nan\n", "line 1: a vertex needs three finite"),
        ("v 0 0 0\nf 1 2\n", "line 2: a face needs at least three"),
        ("v 0 0 0\nf 1 x 2\n", "line 2: 'x' is no face corner"),
        ("v 0 0 0\nf 0 1 1\n", "line 2: vertex 0 does not exist"),
        ("v 0 0 0\nf -2 1 1\n", "line 2: vertex -2 does not exist"),
        ("v 0 0 0\n\nf 1 1 9\n", "line 3: vertex 9 does not exist: the file has 1"),
        ("g nothing\n", "no 'v' lines"),
        ("v 0 0 0\n", "no faces"),
    ],
)
def test_broken_obj_is_told_where(tmp_path: Path, text: str, message: str):
    with pytest.raises(FileError, match=message) as caught:
        read_mesh(_written(tmp_path, text))
    assert "\n" not in str(caught.value)


def _ply(kind: str) -> bytes:
    """A quad and a triangle over five vertices, with a colour that is passed over."""
    header = (
        f"ply\nformat {kind} 1.0\ncomment ours\n"
        "element vertex 5\nproperty float x\nproperty double y\nproperty float z\n"
        "property uchar red\nelement face 2\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0.5, 0)]
    faces = [(0, 1, 2, 3), (1, 4, 2)]
    if kind == "ascii":
        rows = [f"{x} {y} {z} 200" for x, y, z in vertices] + [f"7 {len(f)} {' '.join(map(str, f))}" for f in faces]
        return header + ("\n".join(rows) + "\n").encode()
    end = "<" if kind == "binary_little_endian" else ">"
    vertex = np.dtype([("x", end + "f4"), ("y", end + "f8"), ("z", end + "f4"), ("red", "u1")])
    body = np.array([(*v, 200) for v in vertices], vertex).tobytes()
    for face in faces:
        body += bytes([7, len(face)]) + np.array(face, end + "i4").tobytes()
    return header + body


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_of_every_format(tmp_path: Path, kind: str):
    path = tmp_path / "mesh.ply"
    path.write_bytes(_ply(kind))
    mesh = read_mesh(path)
    assert mesh.quads.tolist() == [[0, 1, 2, 3]]
    assert mesh.triangles.tolist() == [[1, 4, 2]]
    assert mesh.vertices[4].tolist() == [2.0, 0.5, 0.0]


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_ply_cut_off_anywhere_is_refused(tmp_path: Path, kind: str):
    whole = _ply(kind)
    path = tmp_path / "cut.ply"
    for end in range(len(whole) - 2):
        path.write_bytes(whole[:end])
        with pytest.raises(FileError, match=r"cut\.ply"):
            read_mesh(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((b"property double y", b"property double q"), "x, y and z"),
        ((b"vertex_indices", b"corners"), "vertex_indices"),
        ((b"ascii", b"utf8"), "ascii, binary_little_endian"),
        ((b"property uchar red", b"property colour red"), "colour"),
        ((b"1 4 2", b"1 9 2"), "vertex 9"),
    ],
)
def test_broken_ply_is_told_why(tmp_path: Path, change: tuple[bytes, bytes], message: str):
    path = tmp_path / "broken.ply"
    path.write_bytes(_ply("ascii").replace(*change))
    with pytest.raises(FileError, match=message):
        read_mesh(path)


def test_unknown_ending_and_missing_file(tmp_path: Path):
    with pytest.raises(FileError, match=r"use \.obj"):
        read_mesh(tmp_path / "mesh.fbx")
    with pytest.raises(FileError, match="no such file"):
        read_mesh(tmp_path / "mesh.obj")


@pytest.mark.skipif(not _MESHES.is_dir(), reason="needs the shared meshes beside the repository")
def test_a_real_body_keeps_its_quads():
    mesh = read_mesh(_MESHES / "makehuman_body.obj")
    assert (len(mesh.vertices), len(mesh.quads), len(mesh.triangles)) == (13380, 13378, 0)
    assert is_closed(mesh)
    assert euler_characteristic(mesh) == 2
