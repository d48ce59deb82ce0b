"""A polygon mesh of quads and triangles, and what can be said of any: normals, edges, volume, pieces."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from devices.frame import frozen


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh whose faces run counter-clockwise seen from outside.

    vertices: (V, 3) float64 metres.
    quads: (Q, 4) int32 vertex indices; triangles: (F, 3) int32. Either may be empty.
    All three are made read-only.
    """

    vertices: NDArray[np.float64]
    quads: NDArray[np.int32]
    triangles: NDArray[np.int32]

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", _own(self.vertices, np.float64, 3))
        object.__setattr__(self, "quads", _own(self.quads, np.int32, 4))
        object.__setattr__(self, "triangles", _own(self.triangles, np.int32, 3))

    @cached_property
    def triangulated(self) -> NDArray[np.int32]:
        """(2 Q + F, 3) int32: each quad as two triangles (a, b, c), (a, c, d), then the triangles."""
        halves = self.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
        return frozen(np.concatenate([halves, self.triangles]))

    @cached_property
    def half_edges(self) -> NDArray[np.int32]:
        """(4 Q + 3 F, 2) int32: every side of every face as (from, to), faces in order, quads first."""
        return frozen(np.concatenate([_sides(self.quads), _sides(self.triangles)]))

    def with_vertices(self, vertices: NDArray[np.float64]) -> "Mesh":
        """The same faces over other vertices (V, 3) metres."""
        return Mesh(vertices, self.quads, self.triangles)


def all_quads(vertices: NDArray[np.float64], quads: NDArray[np.int32]) -> Mesh:
    """A mesh without triangles."""
    return Mesh(vertices, quads, np.empty((0, 3), np.int32))


def vertex_normals(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    """Area-weighted unit normals (V, 3) of vertices (V, 3) under triangles (F, 3); zero where no face has area.

    The NumPy reference for the frame loop's kernel.
    """
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], face)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0)


def edges(mesh: Mesh) -> NDArray[np.int32]:
    """(E, 2) int32: each edge once, the smaller index first, in ascending order."""
    return np.unique(np.sort(mesh.half_edges, axis=1), axis=0)


def boundary_edges(mesh: Mesh) -> NDArray[np.int32]:
    """(B, 2) int32: the edges that only one face has."""
    pairs, count = np.unique(np.sort(mesh.half_edges, axis=1), axis=0, return_counts=True)
    return pairs[count == 1]


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge has exactly two faces and these run through it in opposite directions."""
    directed = {(int(a), int(b)) for a, b in mesh.half_edges}
    return len(directed) == len(mesh.half_edges) and all((b, a) in directed for a, b in directed)


def euler_characteristic(mesh: Mesh) -> int:
    """V - E + F over the vertices that faces use: 2 for one closed surface without handles."""
    used = np.unique(mesh.half_edges)
    return len(used) - len(edges(mesh)) + len(mesh.quads) + len(mesh.triangles)


def volume(mesh: Mesh) -> float:
    """The signed volume in cubic metres of a closed mesh: positive where its faces look outward."""
    a, b, c = (mesh.vertices[mesh.triangulated[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def surface_area(mesh: Mesh) -> float:
    """The area in square metres."""
    a, b, c = (mesh.vertices[mesh.triangulated[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def components(mesh: Mesh) -> NDArray[np.int32]:
    """(V,) int32: the number of the connected piece each vertex is in, from 0; a loose vertex is a piece of its own."""
    size = len(mesh.vertices)
    a, b = mesh.half_edges.T
    graph = coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(size, size))
    return connected_components(graph, directed=False)[1].astype(np.int32)


def _own(values: NDArray, dtype: type, width: int) -> NDArray:
    return frozen(np.array(values, dtype, order="C").reshape(-1, width))


def _sides(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
