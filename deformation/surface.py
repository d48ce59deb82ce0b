"""The mesh on the lattice: vertices ride in their cells, and faces give normals."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deformation.kernel import kernel
from deformation.lattice import Lattice
from deformation.mesh import Mesh, vertex_normals

_NO_AREA = 1e-300
"""Squared area vector below which a normal stays zero."""

_SAME_WAY = np.cos(np.radians(40))
"""Vertices in one place whose normals are this near to their mean are one vertex cut by a seam."""


def interpolate_reference(lattice: Lattice, particles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vertices (V, 3) metres from particles (P, 3) by trilinear interpolation, in plain NumPy."""
    return np.einsum("vk,vki->vi", lattice.vertex_weights, particles[lattice.cells[lattice.vertex_cells]])


@dataclass(frozen=True, eq=False)
class Seams:
    """Vertices that a file has more than once, for their textures, and that are one for the light.

    members: (M,) int32 vertices, seam by seam; first: (S + 1,) int32 where each seam point's begin.
    """

    first: NDArray[np.int32]
    members: NDArray[np.int32]


def seams(mesh: Mesh) -> Seams:
    """The vertices in one place whose faces look nearly the same way; at a hard edge they do not, and it stays hard."""
    place = np.unique(mesh.vertices, axis=0, return_inverse=True)[1].reshape(-1)
    shared = np.bincount(place)[place] > 1
    if not shared.any():
        return Seams(np.zeros(1, np.int32), np.empty(0, np.int32))
    normals = vertex_normals(mesh.vertices, mesh.triangulated)
    total = np.zeros((place.max() + 1, 3))
    np.add.at(total, place[shared], normals[shared])
    mean = total[place] / np.maximum(np.linalg.norm(total[place], axis=1, keepdims=True), 1e-12)
    shared &= np.einsum("vi,vi->v", normals, mean) > _SAME_WAY
    shared &= np.bincount(place[shared], minlength=len(total))[place] > 1
    members = np.flatnonzero(shared)[np.argsort(place[shared], kind="stable")]
    first = np.flatnonzero(np.diff(place[members], prepend=-1))
    return Seams(np.append(first, len(members)).astype(np.int32), members.astype(np.int32))


class Surface:
    """Carries a mesh with its lattice. Holds what the kernels need in the order they walk through it."""

    def __init__(self, mesh: Mesh, lattice: Lattice) -> None:
        self._quads, self._triangles, self._seams = mesh.quads, mesh.triangles, seams(mesh)
        self._cells = lattice.cells
        self._lengths = np.empty(len(mesh.vertices))
        self._order = np.argsort(lattice.vertex_cells, kind="stable").astype(np.int32)
        self._first = np.searchsorted(lattice.vertex_cells[self._order], np.arange(len(lattice.cells) + 1)).astype(
            np.int32
        )
        self._fractions = np.ascontiguousarray(lattice.vertex_fractions[self._order])

    def vertices(self, particles: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Writes the vertices (V, 3) metres that particles (P, 3) carry."""
        _ride(particles, self._cells, self._first, self._order, self._fractions, out)

    def normals(self, vertices: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Writes area-weighted unit normals (V, 3), one at each seam."""
        _normals(vertices, self._quads, self._triangles, self._seams.first, self._seams.members, self._lengths, out)


@kernel
def _ride(particles, cells, first, order, fractions, out):
    """A cell's motion as a polynomial in the fractions: eight coefficients a cell serve all vertices in it."""
    k = np.empty((8, 3))
    for cell in range(len(cells)):
        if first[cell] == first[cell + 1]:
            continue
        for i in range(3):
            p0, p1 = particles[cells[cell, 0], i], particles[cells[cell, 1], i]
            p2, p3 = particles[cells[cell, 2], i], particles[cells[cell, 3], i]
            p4, p5 = particles[cells[cell, 4], i], particles[cells[cell, 5], i]
            p6, p7 = particles[cells[cell, 6], i], particles[cells[cell, 7], i]
            k[0, i] = p0
            k[1, i] = p1 - p0
            k[2, i] = p2 - p0
            k[3, i] = p3 - p2 - p1 + p0
            k[4, i] = p4 - p0
            k[5, i] = p5 - p4 - p1 + p0
            k[6, i] = p6 - p4 - p2 + p0
            k[7, i] = p7 - p6 - p5 + p4 - p3 + p2 + p1 - p0
        for n in range(first[cell], first[cell + 1]):
            x, y, z = fractions[n, 0], fractions[n, 1], fractions[n, 2]
            vertex = order[n]
            for i in range(3):
                low = k[0, i] + x * k[1, i] + y * (k[2, i] + x * k[3, i])
                high = k[4, i] + x * k[5, i] + y * (k[6, i] + x * k[7, i])
                out[vertex, i] = low + z * high


@kernel
def _normals(vertices, quads, triangles, seam_first, seam_members, lengths, out):
    """Adds each face's area vector to its corners: a quad's is half the cross product of its diagonals."""
    out[:] = 0.0
    for q in range(len(quads)):
        a, b, c, d = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        ux, uy, uz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
        vx, vy, vz = vertices[d, 0] - vertices[b, 0], vertices[d, 1] - vertices[b, 1], vertices[d, 2] - vertices[b, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for n in (a, b, c, d):
            out[n, 0] += x
            out[n, 1] += y
            out[n, 2] += z
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ux, uy, uz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
        vx, vy, vz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for n in (a, b, c):
            out[n, 0] += x
            out[n, 1] += y
            out[n, 2] += z
    for s in range(len(seam_first) - 1):
        x, y, z = 0.0, 0.0, 0.0
        for m in range(seam_first[s], seam_first[s + 1]):
            n = seam_members[m]
            x, y, z = x + out[n, 0], y + out[n, 1], z + out[n, 2]
        for m in range(seam_first[s], seam_first[s + 1]):
            n = seam_members[m]
            out[n, 0], out[n, 1], out[n, 2] = x, y, z
    for n in range(len(out)):  # three loops: the roots in one of their own run on vector units
        lengths[n] = out[n, 0] * out[n, 0] + out[n, 1] * out[n, 1] + out[n, 2] * out[n, 2]
    for n in range(len(out)):
        lengths[n] = 1.0 / np.sqrt(max(lengths[n], _NO_AREA))
    for n in range(len(out)):
        out[n, 0] *= lengths[n]
        out[n, 1] *= lengths[n]
        out[n, 2] *= lengths[n]


def normals_reference(mesh: Mesh, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Area-weighted unit normals (V, 3) in plain NumPy, one at each seam; zero where no face has any area."""
    total = np.zeros_like(vertices)
    a, b, c, d = (vertices[mesh.quads[:, k]] for k in range(4))
    area = np.cross(c - a, d - b)
    for k in range(4):
        np.add.at(total, mesh.quads[:, k], area)
    a, b, c = (vertices[mesh.triangles[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    for k in range(3):
        np.add.at(total, mesh.triangles[:, k], area)
    welded = seams(mesh)
    for first, stop in pairwise(welded.first):
        members = welded.members[first:stop]
        total[members] = total[members].sum(axis=0)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, size, out=np.zeros_like(total), where=size > 0)
