"""A lattice of cubic cells around a body, that is connected as the body is and not as the grid is (paper III-A).

Each cell that the surface touches or that lies inside holds one or more pieces of the body. A piece gets a cell of its
own, and cells share a particle only where the body goes on from one to the other: after Molino, Bao and Fedkiw (2004),
"A virtual node algorithm", and Nesme et al. (2009), "Preserving topology and elasticity for embedded deformable
models". So an arm that hangs beside a hip has its own particles, at any cell size.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from deformation.mesh import Mesh, surface_area, volume
from deformation.voxels import Voxels, voxelise
from devices.errors import SettingError
from devices.frame import frozen

CORNERS = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])
"""(8, 3) offsets of a cell's corners, x fastest."""

VOXELS_PER_CELL = 4
"""How finely the body inside a cell is looked at, along each edge."""

_CORNERS_PER_FACE = 2.1
"""Particles for each cell face of surface beside those for the volume inside, as measured on four bodies."""


_TRIES = 4
"""Lattices that are built in search of one with so many particles."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Cells and their corner particles.

    cell_size: metres.
    particles: (P, 3) metres, rest positions x^0.
    cells: (C, 8) int32 particle of each corner, in the order of `CORNERS`.
    vertex_cells: (V,) int32 the cell each mesh vertex rides in; vertex_fractions: (V, 3) in [0, 1], where in it.
    voxels: the body inside.
    """

    cell_size: float
    particles: NDArray[np.float64]
    cells: NDArray[np.int32]
    vertex_cells: NDArray[np.int32]
    vertex_fractions: NDArray[np.float64]
    voxels: Voxels

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
    points, welded, triangles = _welded(mesh)
    voxels = _voxelised(points, triangles, cell_size)
    coarse, fine = (_pieces(voxels, points, triangles, factor) for factor in (VOXELS_PER_CELL, VOXELS_PER_CELL // 2))
    lattices = [
        _lattice(pieces, voxels, factor, mesh.vertices, _face_of_vertex(welded, triangles))
        for pieces, factor in ((coarse, VOXELS_PER_CELL), (fine, VOXELS_PER_CELL // 2))
    ]
    return lattices[0], lattices[1], frozen(_holding(coarse, fine, voxels))


def _welded(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int32]]:
    """Points (N, 3) without repetition, the point of each vertex (V,), and triangles (F, 3) of points."""
    if not len(mesh.triangulated):
        raise SettingError("the mesh has no faces: nothing to build a lattice around")
    points, welded = np.unique(mesh.vertices, axis=0, return_inverse=True)
    welded = welded.reshape(-1)
    return points, welded, welded[mesh.triangulated].astype(np.int32)


def _voxelised(points: NDArray[np.float64], triangles: NDArray[np.int32], cell_size: float) -> Voxels:
    """The inside, each cell cut into `VOXELS_PER_CELL` along its edges; raises as `build_lattices` does."""
    if not cell_size > 0:
        raise SettingError(f"cell size {cell_size} m: use a positive length, such as 0.05")
    low, high = points.min(axis=0), points.max(axis=0)
    count = np.floor((high - low) / cell_size).astype(np.int64) + 1
    if np.prod(count * VOXELS_PER_CELL) > 3e7:
        raise SettingError(
            f"cell size {cell_size} m is too small for a body of {(high - low).round(2)} m: use a larger one"
        )
    origin = (low + high) / 2 - count * cell_size / 2
    nx, ny, nz = (int(n) for n in count * VOXELS_PER_CELL)
    return voxelise(points, triangles, origin, cell_size / VOXELS_PER_CELL, (nx, ny, nz))


def expected_cell_size(mesh: Mesh, particles: int) -> float:
    """The cell size in metres at which a lattice is expected to have about so many particles, without building one.

    Solves V / h^3 + k A / h^2 = particles for the volume V and the area A of the mesh.
    """
    spread, inside = _CORNERS_PER_FACE * surface_area(mesh), abs(volume(mesh))
    low, high = np.sqrt(spread / particles), np.sqrt(spread / particles) + np.cbrt(inside / particles)
    for _ in range(60):
        size = (low + high) / 2
        expected = inside / size**3 + spread / size**2
        low, high = (size, high) if expected > particles else (low, size)
    return float(high)


def cell_size_for(mesh: Mesh, particles: int) -> float:
    """The cell size in metres at which a mesh's lattice has about so many particles. Raises SettingError below 50.

    The number jumps as cells come and go at the body's outline, so that not every number can be met.
    """
    if particles < 50:
        raise SettingError(f"{particles} lattice particles: use at least 50")
    size = expected_cell_size(mesh, particles)
    points, _, triangles = _welded(mesh)
    tried: dict[float, int] = {}
    for _ in range(_TRIES):
        count, _ = _corner_particles(_pieces(_voxelised(points, triangles, size), points, triangles, VOXELS_PER_CELL))
        tried[size] = abs(count - particles)
        if tried[size] <= 0.02 * particles:
            break
        size *= float((count / particles) ** (1 / 2.4))
    return min(tried, key=lambda size: tried[size])


def _pieces(voxels: Voxels, points: NDArray[np.float64], triangles: NDArray[np.int32], factor: int) -> _Pieces:
    """Divides the body into the pieces within cells of `factor` voxels.

    A piece is made of inside voxels and of the parts of triangles within its cell: nodes of a graph, voxels first.
    """
    shape = tuple(n // factor for n in voxels.shape)
    cell, face = _touched_cells((points[triangles] - voxels.origin) / (voxels.size * factor), np.array(shape))
    number = np.asarray(np.ravel_multi_index(tuple(cell.T), shape), np.int64)
    order = np.argsort(number * len(triangles) + face)
    cell, face, number = cell[order], face[order], number[order]
    keys = number * len(triangles) + face
    solid = len(voxels.solid)
    of_voxel = np.asarray(np.ravel_multi_index(tuple((voxels.solid // factor).T), shape), np.int64)
    edges = _links_within(voxels, of_voxel, keys, triangles)
    pieces, label = _components(edges, solid + len(keys))
    cell_of = np.empty((pieces, 3), np.int64)
    cell_of[label[:solid]] = voxels.solid // factor
    cell_of[label[solid:]] = cell
    links = np.concatenate([label[voxels.links], *_same_face_pairs(face, label[solid:])])
    near = (np.abs(cell_of[links[:, 0]] - cell_of[links[:, 1]]) <= 1).all(axis=1) & (links[:, 0] != links[:, 1])
    key = np.unique(links[near, 0] * pieces + links[near, 1])
    return _Pieces(
        cell_of, label[:solid], keys, label[solid:], len(triangles), np.stack([key // pieces, key % pieces], axis=1)
    )


def _links_within(
    voxels: Voxels, cell_of_voxel: NDArray[np.integer], keys: NDArray[np.int64], triangles: NDArray[np.int32]
) -> NDArray[np.int64]:
    """(L, 2) nodes that hang together within their cell: voxels side by side, a voxel and the surface it meets,
    triangles that share an edge."""
    number, face = keys // len(triangles), keys % len(triangles)
    solid = len(voxels.solid)

    def part(cells: NDArray[np.integer], faces: NDArray[np.integer]) -> NDArray[np.int64]:
        """The node of a triangle in a cell, -1 where it does not reach there."""
        wanted = cells * len(triangles) + faces
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[place] == wanted, place + solid, -1)

    a, b = voxels.links.T
    same = cell_of_voxel[a] == cell_of_voxel[b]
    voxel, touched = voxels.contacts.T
    met = part(cell_of_voxel[voxel], touched)
    row, other = _neighbours_of(face, triangles)
    beside = part(number[row], other)
    return np.concatenate(
        [
            voxels.links[same].astype(np.int64),
            np.stack([voxel, met], axis=1)[met >= 0],
            np.stack([row + solid, beside], axis=1)[beside >= 0],
        ]
    )


def _components(pairs: NDArray[np.integer], nodes: int) -> tuple[int, NDArray[np.int64]]:
    """How many connected pieces pairs (L, 2) make of the nodes, and the piece (nodes,) that each is in."""
    graph = coo_matrix((np.ones(len(pairs), np.int8), tuple(pairs.T)), shape=(nodes, nodes))
    count, label = connected_components(graph, directed=False)
    return int(count), np.asarray(label, np.int64)


def _touched_cells(
    corners: NDArray[np.float64], shape: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(M, 3) cells and (M,) triangles that touch, for triangles (F, 3, 3) in cell units.

    The separating axis test of Akenine-Moller, "Fast 3D triangle-box overlap testing" (2001).
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    low = np.clip(np.floor(np.minimum(np.minimum(a, b), c)).astype(np.int64), 0, shape - 1)
    high = np.clip(np.floor(np.maximum(np.maximum(a, b), c)).astype(np.int64), 0, shape - 1)
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
        a, b, c = (np.einsum("nj,nj->n", corners[:, corner], axis) for corner in range(3))
        radius = 0.5 * (np.abs(axis) @ np.ones(3)) + 1e-12
        touching &= (np.minimum(np.minimum(a, b), c) <= radius) & (np.maximum(np.maximum(a, b), c) >= -radius)
    return touching


def _neighbours_of(
    face: NDArray[np.int64], triangles: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each row of `face` and each triangle that shares an edge with it: (rows, triangles), each pair once."""
    sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    key = sides[:, 0] * (int(triangles.max()) + 1) + sides[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    source, target = order[same] // 3, order[same + 1] // 3
    by_source = np.argsort(source, kind="stable")
    source, target = source[by_source], target[by_source]
    start = np.searchsorted(source, face)
    count = np.searchsorted(source, face, side="right") - start
    rows = np.repeat(np.arange(len(face)), count)
    nth = np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count)
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
    """One cell a piece."""
    size = voxels.size * factor
    count, particle = _corner_particles(pieces)
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
        voxels,
    )


def _corner_particles(pieces: _Pieces) -> tuple[int, NDArray[np.int64]]:
    """How many particles there are, and each cell corner's (8 K,): one particle where linked pieces meet."""
    a, b = pieces.links.T
    shift = pieces.cell[b] - pieces.cell[a]
    joined = []
    for number, corner in enumerate(CORNERS):
        there = corner - shift
        shared = ((there == 0) | (there == 1)).all(axis=1)
        joined.append(np.stack([8 * a + number, 8 * b + there @ [1, 2, 4]], axis=1)[shared])
    return _components(np.concatenate(joined), 8 * len(pieces.cell))


def _vertex_cells(
    pieces: _Pieces, voxels: Voxels, factor: int, vertices: NDArray[np.float64], face_of_vertex: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(V,) the piece that a vertex's surface belongs to in the cell it stands in; a loose vertex takes the nearest."""
    shape = np.array(voxels.shape) // factor
    cell = np.clip(np.floor((vertices - voxels.origin) / (voxels.size * factor)).astype(np.int64), 0, shape - 1)
    key = np.ravel_multi_index(tuple(cell.T), tuple(shape)) * pieces.faces + face_of_vertex
    place = np.minimum(np.searchsorted(pieces.keys, key), len(pieces.keys) - 1)
    known = (face_of_vertex >= 0) & (pieces.keys[place] == key)
    found = np.where(known, pieces.of_key[place], -1)
    if not known.all():
        nearest = KDTree(vertices[known]).query(vertices[~known])[1]
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
