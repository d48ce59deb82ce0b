"""Meshes from files: `read_mesh` knows the format by the file's ending."""

from collections.abc import Callable
from pathlib import Path

from deformation.mesh import Mesh
from deformation.mesh_files.glb import glb_mesh, read_glb
from deformation.mesh_files.obj import read_obj
from deformation.mesh_files.ply import read_ply
from devices.errors import FileError


def _shown_by_glb(path: Path) -> Mesh:
    return glb_mesh(read_glb(path))


_READERS: dict[str, Callable[[Path], Mesh]] = {
    ".obj": read_obj,
    ".ply": read_ply,
    ".glb": _shown_by_glb,
    ".gltf": _shown_by_glb,
    ".vrm": _shown_by_glb,
}


def read_mesh(path: str | Path) -> Mesh:
    """The mesh in a file, in the file's own units and axes. Raises FileError, which names the file and the line."""
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise FileError(f"{path}: no mesh format is called {path.suffix!r}: use {', '.join(_READERS)}")
    if not path.is_file():
        raise FileError(f"{path}: no such file")
    mesh = reader(path)
    if not len(mesh.triangulated):
        raise FileError(f"{path}: it has no faces; a mesh needs at least one")
    return mesh
