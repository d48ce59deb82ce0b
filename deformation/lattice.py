"""A lattice of cubic cells around a body, that is connected as the body is and not as the grid is (paper III-A).

Each cell that the surface touches or that lies inside holds one or more pieces of the body. A piece gets a cell of its
own, and cells share a particle only where the body goes on from one to the other: after Molino, Bao and Fedkiw (2004),
"A virtual node algorithm", and Nesme et al. (2009), "Preserving topology and elasticity for embedded deformable
models". So an arm that hangs beside a hip has its own particles, at any cell size.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from deformation.mesh import Mesh
from deformation.voxels import Voxels, voxelise
from devices.errors import SettingError
from devices.frame import frozen

CORNERS = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])
"""(8, 3) offsets of a cell's corners, x fastest."""

VOXELS_PER_CELL = 4
"""How finely the body inside a cell is looked at, along each edge."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Cells and their corner particles.

    cell_size: metres.
    particles: (P, 3) metres, rest positions x^0.
    cells: (C, 8) int32 particle of each corner, in the order of `CORNERS`.
    vertex_cells: (V,) int32 the cell each mesh vertex rides in; vertex_fractions: (V, 3) in [0, 1], where in it.
    """

    cell_size: float
    particles: NDArray[np.float64]
    cells: NDArray[np.int32]
    vertex_cells: NDArray[np.int32]
    vertex_fractions: NDArray[np.float64]

    @property
    def vertex_weights(self) -> NDArray[np.float64]:
        """(V, 8) trilinear weight of each corner of the vertex's cell."""
        return trilinear(self.vertex_fractions)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """The connected pieces of the body within each cell of one cell size.

    cell: (K, 3) grid cell of each piece; of_voxel: (N,) piece of each inside voxel.
    keys: (M,) ascending `cell number * triangles + triangle` of each triangle in each cell it touches; of_key: (M,);
    faces: triangles.
    links: (L, 2) pieces of neighbouring cells that hang together.
    """

    cell: NDArray[np.int64]
    of_voxel: NDArray[np.int64]
    keys: NDArray[np.int64]
    of_key: NDArray[np.int64]
    faces: int
    links: NDArray[np.int64]


def trilinear(fractions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 8) weights of a cell's corners at fractions (N, 3) of its edges; rows sum to 1."""
    f = fractions[:, None, :]
    return np.where(CORNERS, f, 1 - f).prod(axis=2)


def build_lattices(mesh: Mesh, cell_size: float) -> tuple[Lattice, Lattice, NDArray[np.int32]]:
    """The lattice of a mesh, one of half its cell size, and the coarse cell (C_fine,) that holds each fine cell.

    cell_size: metres. Raises SettingError where it is not positive or gives more than some millions of voxels.
    """
    if not len(mesh.triangulated):
        raise SettingError("the mesh has no faces: nothing to build a lattice around")
    if not cell_size > 0:
        raise SettingError(f"cell size {cell_size} m: use a positive length, such as 0.05")
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    count = np.floor((high - low) / cell_size).astype(np.int64) + 1
    if np.prod(count * VOXELS_PER_CELL) > 3e7:
        raise SettingError(
            f"cell size {cell_size} m is too small for a body of {(high - low).round(2)} m: use a larger one"
        )
    origin = (low + high) / 2 - count * cell_size / 2
    points, welded = np.unique(mesh.vertices, axis=0, return_inverse=True)
    triangles = welded.reshape(-1)[mesh.triangulated].astype(np.int32)
    nx, ny, nz = (int(n) for n in count * VOXELS_PER_CELL)
    voxels = voxelise(points, triangles, origin, cell_size / VOXELS_PER_CELL, (nx, ny, nz))
    coarse, fine = (_pieces(voxels, points, triangles, factor) for factor in (VOXELS_PER_CELL, VOXELS_PER_CELL // 2))
    lattices = [
        _lattice(pieces, voxels, factor, mesh.vertices, _face_of_vertex(welded.reshape(-1), triangles))
        for pieces, factor in ((coarse, VOXELS_PER_CELL), (fine, VOXELS_PER_CELL // 2))
    ]
    return lattices[0], lattices[1], frozen(_holding(coarse, fine, voxels))


def cell_size_for(mesh: Mesh, particles: int) -> float:
    """The cell size in metres at which a mesh's lattice has about so many particles. Raises SettingError below 50."""
    if particles < 50:
        raise SettingError(f"{particles} lattice particles: use at least 50")
    extent = mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)
    size = float(np.cbrt(np.prod(extent) / particles))
    for _ in range(6):
        count = len(build_lattices(mesh, size)[0].particles)
        if abs(count - particles) <= 0.01 * particles:
            break
        size *= float((count / particles) ** (1 / 2.4))
    return size


def _pieces(voxels: Voxels, points: NDArray[np.float64], triangles: NDArray[np.int32], factor: int) -> _Pieces:
    """Divides the body into the pieces within cells of `factor` voxels."""
    shape = np.array(voxels.shape) // factor
    cell, face = _touched_cells((points[triangles] - voxels.origin) / (voxels.size * factor), shape)
    number = np.ravel_multi_index(tuple(cell.T), tuple(shape))
    order = np.argsort(number * len(triangles) + face)
    cell, face, number = cell[order], face[order], number[order]
    keys = number * len(triangles) + face
    of_solid = np.ravel_multi_index(tuple((voxels.solid // factor).T), tuple(shape))
    nodes = len(voxels.solid) + len(keys)

    def find(cells: NDArray[np.int64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """The node of a triangle in a cell, -1 where it does not touch it."""
        wanted = cells * len(triangles) + faces
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[place] == wanted, place + len(voxels.solid), -1)

    side_by_side = _neighbour_faces(triangles)
    neighbour = [(face_a, face_b) for face_a, face_b in (side_by_side.T, side_by_side[:, ::-1].T)]
    local = [voxels.links[of_solid[voxels.links[:, 0]] == of_solid[voxels.links[:, 1]]]]
    touching = find(of_solid[voxels.contacts[:, 0]], voxels.contacts[:, 1])
    local.append(np.stack([voxels.contacts[:, 0], touching], axis=1)[touching >= 0])
    row, other = _pairs_of(face, neighbour)
    found = find(number[row], other)
    local.append(np.stack([row + len(voxels.solid), found], axis=1)[found >= 0])
    edges = np.concatenate(local)
    graph = coo_matrix((np.ones(len(edges), np.int8), tuple(edges.T)), shape=(nodes, nodes))
    pieces, label = connected_components(graph, directed=False)
    cell_of = np.empty((pieces, 3), np.int64)
    cell_of[label[: len(voxels.solid)]] = voxels.solid // factor
    cell_of[label[len(voxels.solid) :]] = cell
    across = [label[voxels.links], *_same_face_pairs(face, label[len(voxels.solid) :])]
    links = np.concatenate(across)
    near = (np.abs(cell_of[links[:, 0]] - cell_of[links[:, 1]]).max(axis=1) <= 1) & (links[:, 0] != links[:, 1])
    return _Pieces(
        cell_of,
        label[: len(voxels.solid)],
        keys,
        label[len(voxels.solid) :],
        len(triangles),
        np.unique(links[near], axis=0),
    )


def _touched_cells(
    corners: NDArray[np.float64], shape: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(M, 3) cells and (M,) triangles that touch, for triangles (F, 3, 3) in cell units.

    The separating axis test of Akenine-Moller, "Fast 3D triangle-box overlap testing" (2001).
    """
    low = np.clip(np.floor(corners.min(axis=1)).astype(np.int64), 0, shape - 1)
    high = np.clip(np.floor(corners.max(axis=1)).astype(np.int64), 0, shape - 1)
    count = high - low + 1
    total = count.prod(axis=1)
    face = np.repeat(np.arange(len(corners)), total)
    nth = np.arange(len(face)) - np.repeat(np.cumsum(total) - total, total)
    ny, nz = count[face, 1], count[face, 2]
    cell = low[face] + np.stack([nth // (ny * nz), nth // nz % ny, nth % nz], axis=1)
    several = np.flatnonzero(total[face] > 1)
    keep = np.ones(len(face), bool)
    keep[several] = _overlaps(corners[face[several]] - (cell[several] + 0.5)[:, None, :])
    return cell[keep], face[keep]


def _overlaps(corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether triangles (N, 3, 3) reach into the unit cube around the origin; their bounding boxes are known to."""
    sides = np.roll(corners, -1, axis=1) - corners
    axes = [np.cross(sides[:, 0], sides[:, 1])]
    axes += [np.cross(np.eye(3)[axis], sides[:, side]) for axis in range(3) for side in range(3)]
    touching = np.ones(len(corners), bool)
    for axis in axes:
        reach = np.einsum("nij,nj->ni", corners, axis)
        radius = 0.5 * np.abs(axis).sum(axis=1) + 1e-12
        touching &= (reach.min(axis=1) <= radius) & (reach.max(axis=1) >= -radius)
    return touching


def _neighbour_faces(triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """(E, 2) triangles that share an edge."""
    sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    key = sides[:, 0] * (int(triangles.max()) + 1) + sides[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    return np.stack([order[same] // 3, order[same + 1] // 3], axis=1)


def _pairs_of(
    face: NDArray[np.int64], neighbours: Sequence[tuple[NDArray[np.int64], NDArray[np.int64]]]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each row of `face` and each neighbour of its triangle: (rows, neighbours)."""
    source = np.concatenate([a for a, _ in neighbours])
    target = np.concatenate([b for _, b in neighbours])
    order = np.argsort(source, kind="stable")
    source, target = source[order], target[order]
    start, stop = np.searchsorted(source, face), np.searchsorted(source, face, side="right")
    rows = np.repeat(np.arange(len(face)), stop - start)
    nth = np.arange(len(rows)) - np.repeat(np.cumsum(stop - start) - (stop - start), stop - start)
    return rows, target[start[rows] + nth]


def _same_face_pairs(face: NDArray[np.int64], piece: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """(N, 2) pieces that one triangle belongs to, a list of arrays."""
    order = np.argsort(face, kind="stable")
    face, piece = face[order], piece[order]
    pairs = []
    for step in range(1, int(np.bincount(face).max())):
        same = face[step:] == face[:-step]
        pairs.append(np.stack([piece[:-step][same], piece[step:][same]], axis=1))
    return pairs


def _face_of_vertex(welded: NDArray[np.int64], triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """(V,) one triangle at each vertex, -1 where it has none."""
    face = np.full(int(welded.max()) + 1, -1, np.int64)
    face[triangles.reshape(-1)] = np.repeat(np.arange(len(triangles)), 3)
    return face[welded]


def _lattice(
    pieces: _Pieces, voxels: Voxels, factor: int, vertices: NDArray[np.float64], face_of_vertex: NDArray[np.int64]
) -> Lattice:
    """One cell a piece; corners become one particle where linked pieces meet."""
    size = voxels.size * factor
    a, b = pieces.links.T
    shift = pieces.cell[b] - pieces.cell[a]
    joined = []
    for number, corner in enumerate(CORNERS):
        there = corner - shift
        shared = ((there == 0) | (there == 1)).all(axis=1)
        joined.append(np.stack([8 * a + number, 8 * b + there @ [1, 2, 4]], axis=1)[shared])
    pairs = np.concatenate(joined)
    corners = 8 * len(pieces.cell)
    graph = coo_matrix((np.ones(len(pairs), np.int8), tuple(pairs.T)), shape=(corners, corners))
    count, particle = connected_components(graph, directed=False)
    cells = particle.reshape(-1, 8).astype(np.int32)
    position = np.empty((count, 3))
    position[cells] = voxels.origin + (pieces.cell[:, None, :] + CORNERS) * size
    vertex_cells = _vertex_cells(pieces, voxels, factor, vertices, face_of_vertex)
    fractions = (vertices - voxels.origin) / size - pieces.cell[vertex_cells]
    return Lattice(
        size,
        frozen(position),
        frozen(cells),
        frozen(vertex_cells.astype(np.int32)),
        frozen(np.ascontiguousarray(fractions)),
    )


def _vertex_cells(
    pieces: _Pieces, voxels: Voxels, factor: int, vertices: NDArray[np.float64], face_of_vertex: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(V,) the piece that a vertex's surface belongs to in the cell it stands in; a loose vertex takes the nearest."""
    from scipy.spatial import cKDTree

    shape = np.array(voxels.shape) // factor
    cell = np.clip(np.floor((vertices - voxels.origin) / (voxels.size * factor)).astype(np.int64), 0, shape - 1)
    key = np.ravel_multi_index(tuple(cell.T), tuple(shape)) * pieces.faces + face_of_vertex
    place = np.minimum(np.searchsorted(pieces.keys, key), len(pieces.keys) - 1)
    known = (face_of_vertex >= 0) & (pieces.keys[place] == key)
    found = np.where(known, pieces.of_key[place], -1)
    if not known.all():
        nearest = cKDTree(vertices[known]).query(vertices[~known])[1]
        found[~known] = found[known][nearest]
    return found


def _holding(coarse: _Pieces, fine: _Pieces, voxels: Voxels) -> NDArray[np.int32]:
    """The coarse piece that each fine piece is part of: (K_fine,)."""
    shape = np.array(voxels.shape) // (VOXELS_PER_CELL // 2)
    held = np.full(len(fine.cell), -1, np.int64)
    number, face = np.divmod(fine.keys, fine.faces)
    parent = np.stack(np.unravel_index(number, tuple(shape)), axis=1) // 2
    key = np.ravel_multi_index(tuple(parent.T), tuple(shape // 2)) * coarse.faces + face
    held[fine.of_key] = coarse.of_key[np.minimum(np.searchsorted(coarse.keys, key), len(coarse.keys) - 1)]
    held[fine.of_voxel] = coarse.of_voxel
    return held.astype(np.int32)
