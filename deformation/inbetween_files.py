"""Shapes of one mesh as files: an OBJ each, or one archive of vertices."""

import os
import shutil
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deformation.mesh import Mesh


def write_shapes(mesh: Mesh, shapes: Iterable[NDArray[np.float64]], out: Path) -> int:
    """Writes shapes (V, 3) as `0000.obj` and on in the folder `out`, or as `vertices` (T, V, 3) of an .npz.

    Written beside and renamed into place. Returns how many there are.
    Raises OSError.
    """
    partial = out.with_name(f".{out.name}.partial")
    try:
        if out.suffix.lower() == ".npz":
            vertices = np.array(list(shapes))
            with partial.open("wb") as file:
                np.savez(file, vertices=vertices.astype(np.float32), quads=mesh.quads, triangles=mesh.triangles)
            os.replace(partial, out)
            return len(vertices)
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        faces = "".join(f"f {' '.join(str(v + 1) for v in face)}\n" for face in _faces(mesh))
        count = 0
        for count, vertices in enumerate(shapes, start=1):
            lines = "".join(f"v {x:.7g} {y:.7g} {z:.7g}\n" for x, y, z in vertices.tolist())
            (partial / f"{count - 1:04d}.obj").write_text(lines + faces, encoding="utf-8")
        out.mkdir(exist_ok=True)
        for path in sorted(partial.iterdir()):
            os.replace(path, out / path.name)
        return count
    finally:
        if partial.is_dir():
            shutil.rmtree(partial)
        else:
            partial.unlink(missing_ok=True)


def _faces(mesh: Mesh) -> list[list[int]]:
    return [*mesh.quads.tolist(), *mesh.triangles.tolist()]
