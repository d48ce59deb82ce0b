"""What the mesh readers share: faces of any size become quads and triangles."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from deformation.mesh import Mesh


def mesh_of_faces(vertices: NDArray[np.float64], faces: Iterable[Sequence[int]]) -> Mesh:
    """Quads and triangles are kept; a larger face is cut into a fan of triangles from its first corner."""
    quads: list[Sequence[int]] = []
    triangles: list[Sequence[int]] = []
    for face in faces:
        if len(face) == 4:
            quads.append(face)
        else:
            triangles.extend((face[0], face[i], face[i + 1]) for i in range(1, len(face) - 1))
    return Mesh(vertices, _array(quads, 4), _array(triangles, 3))


def _array(faces: list[Sequence[int]], width: int) -> NDArray[np.int32]:
    return np.array(faces, np.int32).reshape(-1, width)
