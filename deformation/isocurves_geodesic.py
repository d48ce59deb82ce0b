"""Distances over a surface of any make: triangles or quads, seams of texture, loose shells.

The path for meshes whose faces give no iso-parametric curves: the level sets of a geodesic distance from the end of a
limb run around it as such curves would (Baerentzen et al. 2014 slice along harmonic functions instead).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import KDTree

from deformation.kernel import kernel
from deformation.mesh import Mesh
from deformation.mesh_repair import same_places
from devices.frame import frozen

_BRIDGE_SHARE = 0.015
"""Shells nearer to each other than this share of the mesh's diagonal count as joined."""


@dataclass(frozen=True, eq=False)
class SurfaceGraph:
    """A surface as a graph of ways, seams welded and shells bridged.

    vertices: (V, 3) metres, welded. triangles: (F, 3) int32. ways: (V, V) symmetric lengths in metres.
    areas: (V,) square metres, a third of the triangles around each vertex.
    places: the number of each of the mesh's vertices here; -1 where no face uses it.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]
    ways: csr_matrix
    areas: NDArray[np.float64]
    places: NDArray[np.int64]

    def distances(self, source: int | list[int]) -> NDArray[np.float64]:
        """(V,) metres to the nearest of the source vertices along the surface."""
        sources = [source] if isinstance(source, int) else source
        return dijkstra(self.ways, directed=False, indices=sources, min_only=True)


def surface_graph(mesh: Mesh) -> SurfaceGraph:
    """The graph of a mesh: along edges and across pairs of triangles, so that ways are but a few percent too long."""
    place = same_places(mesh.vertices)
    used, triangles = np.unique(place[mesh.triangulated], return_inverse=True)
    triangles = triangles.reshape(-1, 3).astype(np.int32)
    vertices = mesh.vertices[used]
    corners = vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    links = _each_once(np.concatenate([_sides(triangles), _across(triangles)]), len(vertices))
    links = np.concatenate([links, _bridges(vertices, links)])
    lengths = np.maximum(np.linalg.norm(vertices[links[:, 0]] - vertices[links[:, 1]], axis=1), 1e-9)
    size = len(vertices)
    half = coo_matrix((lengths, (links[:, 0], links[:, 1])), shape=(size, size))
    areas = np.bincount(triangles.ravel(), np.repeat(area / 3, 3), size)
    places = np.searchsorted(used, place)
    places[~np.isin(place, used)] = -1
    return SurfaceGraph(frozen(vertices), frozen(triangles), csr_matrix(half + half.T), frozen(areas), frozen(places))


def _each_once(pairs: NDArray[np.int32], size: int) -> NDArray[np.int32]:
    """(M, 2) the pairs (N, 2) of numbers below `size`, lower first, each once."""
    names = np.unique(pairs.min(axis=1).astype(np.int64) * size + pairs.max(axis=1))
    return np.stack([names // size, names % size], axis=1).astype(np.int32)


def open_rim(graph: SurfaceGraph) -> NDArray[np.int64]:
    """(N,) the vertices of the longest rim of an open surface; none where it is closed."""
    sides = _sides(graph.triangles).astype(np.int64)
    size = len(graph.vertices)
    names, count = np.unique(sides.min(axis=1) * size + sides.max(axis=1), return_counts=True)
    ends = np.stack([names // size, names % size], axis=1)[count == 1]
    if not len(ends):
        return np.empty(0, np.int64)
    lengths = np.linalg.norm(graph.vertices[ends[:, 1]] - graph.vertices[ends[:, 0]], axis=1)
    _, piece = connected_components(coo_matrix((np.ones(len(ends)), ends.T), shape=(size, size)), directed=False)
    longest = np.bincount(piece[ends[:, 0]], lengths).argmax()
    return np.unique(ends[piece[ends[:, 0]] == longest])


def _sides(triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def _across(triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """(N, 2) the far corners of each two triangles that share an edge."""
    sides = _sides(triangles).astype(np.int64)
    far = triangles[:, [2, 0, 1]].ravel()
    name = sides.min(axis=1) * (triangles.max(initial=0) + 1) + sides.max(axis=1)
    order = np.argsort(name, kind="stable")
    same = np.diff(name[order]) == 0
    pairs = np.stack([far[order[:-1]][same], far[order[1:]][same]], axis=1)
    return pairs[pairs[:, 0] != pairs[:, 1]]


def _bridges(vertices: NDArray[np.float64], links: NDArray[np.int32]) -> NDArray[np.int32]:
    """(N, 2) links that join the shells: wherever two come near, and at their nearest points where none does."""
    size = len(vertices)
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))

    def shells(pairs: NDArray[np.int32]) -> tuple[int, NDArray[np.int32]]:
        return connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(size, size)), directed=False)

    count, shell = shells(links)
    if count == 1:
        return np.empty((0, 2), np.int32)
    away, near = KDTree(vertices).query(vertices, k=min(16, size), distance_upper_bound=_BRIDGE_SHARE * diagonal)
    rows, columns = np.nonzero(np.isfinite(away))
    pairs = np.stack([rows, np.asarray(near)[rows, columns]], axis=1).astype(np.int32)
    bridges = pairs[shell[pairs[:, 0]] != shell[pairs[:, 1]]]
    while True:
        count, shell = shells(np.concatenate([links, bridges]))
        if count == 1:
            return bridges
        main = shell == np.bincount(shell).argmax()
        away, near = KDTree(vertices[main]).query(vertices[~main])
        closest = int(np.argmin(away))
        bridge = [np.flatnonzero(~main)[closest], np.flatnonzero(main)[np.asarray(near)[closest]]]
        bridges = np.concatenate([bridges, np.array([bridge], np.int32)])


def mean_distance(graph: SurfaceGraph, samples: int = 12) -> NDArray[np.float64]:
    """(V,) metres: mean distance to all of the surface, from as many points spread over it, each for what is nearest.

    Largest at the ends of limbs and smallest in the middle of the trunk, whatever the pose (Hilaga et al. 2001).
    """
    point = int(np.argmax(graph.distances(0)))
    fields = [graph.distances(point)]
    for _ in range(samples - 1):
        fields.append(graph.distances(int(np.argmax(np.min(fields, axis=0)))))
    stack = np.array(fields)
    share = np.bincount(np.argmin(stack, axis=0), graph.areas, samples) / graph.areas.sum()
    return share @ stack


@dataclass(frozen=True, eq=False)
class Peaks:
    """Maxima of a field, the most persistent first.

    tops: (N,) vertices; heights: (N,) how far each stands above the saddle to a higher one;
    saddles: (N,) the vertices of these saddles, -1 for the highest of all.
    """

    tops: NDArray[np.int64]
    heights: NDArray[np.float64]
    saddles: NDArray[np.int64]


def peaks(graph: SurfaceGraph, field: NDArray[np.float64], least: float) -> Peaks:
    """The maxima of field (V,) that stand at least `least` above their saddles (Edelsbrunner et al. 2002)."""
    order = np.argsort(-field, kind="stable")
    tops, saddles = _merge(order, field, graph.ways.indptr, graph.ways.indices)
    floor = np.where(saddles >= 0, field[saddles], -np.inf)
    heights = np.where(np.isfinite(floor), field[tops] - floor, field[tops] - field.min())
    keep = np.flatnonzero(heights >= least)
    keep = keep[np.argsort(-heights[keep], kind="stable")]
    return Peaks(tops[keep], heights[keep], saddles[keep])


@kernel
def _find(parent, v):
    while parent[v] != v:
        parent[v] = parent[parent[v]]
        v = parent[v]
    return v


@kernel
def _merge(order, field, first, neighbours):
    """Floods from above; where two lakes meet, the one with the lower top ends there."""
    parent = np.full(len(order), -1, np.int64)
    tops = np.empty(len(order), np.int64)
    saddles = np.empty(len(order), np.int64)
    count = 0
    for v in order:
        parent[v] = v
        for n in range(first[v], first[v + 1]):
            if parent[neighbours[n]] < 0:
                continue
            a, b = _find(parent, v), _find(parent, neighbours[n])
            if a == b:
                continue
            if field[a] < field[b] or (field[a] == field[b] and a > b):
                a, b = b, a
            if b != v:
                tops[count] = b
                saddles[count] = v
                count += 1
            parent[b] = a
    tops[count] = _find(parent, order[0])
    saddles[count] = -1
    return tops[: count + 1], saddles[: count + 1]


@dataclass(frozen=True, eq=False)
class Rings:
    """Closed or open curves around a limb, outermost first.

    levels: (N,) metres of the field. centres: (N, 3) metres. girths: (N,) metres, their lengths.
    """

    levels: NDArray[np.float64]
    centres: NDArray[np.float64]
    girths: NDArray[np.float64]


def level_rings(graph: SurfaceGraph, field: NDArray[np.float64], levels: NDArray[np.float64]) -> Rings:
    """The longest curve at each level of a field (V,).

    Levels without any curve are left out; the centre of one is the mean along its length (paper section 5).
    """
    found = []
    corners = field[graph.triangles]
    lowest, highest = corners.min(axis=1), corners.max(axis=1)
    for level in levels:
        cut = np.flatnonzero((lowest < level) & (highest >= level))
        if len(cut):
            found.append((level, *_longest_loop(graph, field, cut, float(level))))
    columns = list(zip(*found, strict=True)) if found else [[], np.empty((0, 3)), []]
    return Rings(*(frozen(np.array(column, float)) for column in columns))


def slices(
    graph: SurfaceGraph, field: NDArray[np.float64], cut: NDArray[np.intp], level: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Where the triangles `cut` meet a level: segments (S, 2, 3) metres, and (S, 2) numbers of their ends' edges."""
    triangles = graph.triangles[cut]
    above = field[triangles] >= level
    alone = np.where(above.sum(axis=1) == 1, np.argmax(above, axis=1), np.argmin(above, axis=1))
    rows = np.arange(len(cut))
    apex = triangles[rows, alone]
    ends = np.stack([triangles[rows, (alone + 1) % 3], triangles[rows, (alone + 2) % 3]], axis=1)
    share = (level - field[apex])[:, None] / (field[ends] - field[apex][:, None])
    start = graph.vertices[apex][:, None]
    points = start + share[..., None] * (graph.vertices[ends] - start)
    low, high = np.minimum(apex[:, None], ends), np.maximum(apex[:, None], ends)
    return points, low.astype(np.int64) * len(graph.vertices) + high


def _longest_loop(
    graph: SurfaceGraph, field: NDArray[np.float64], cut: NDArray[np.intp], level: float
) -> tuple[NDArray[np.float64], float]:
    return _longest(*slices(graph, field, cut, level))


def longest_reference(points: NDArray[np.float64], names: NDArray[np.int64]) -> tuple[NDArray[np.float64], float]:
    """Centre (3,) and length in metres of the longest piece of segments (S, 2, 3) whose ends have names (S, 2)."""
    _, numbers = np.unique(names, return_inverse=True)
    ends = numbers.reshape(-1, 2)
    size = int(ends.max()) + 1
    _, piece = connected_components(coo_matrix((np.ones(len(ends)), ends.T), shape=(size, size)), directed=False)
    piece = piece[ends[:, 0]]
    lengths = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
    main = piece == np.bincount(piece, lengths).argmax()
    weight = np.where(main, lengths, 0.0)
    return weight @ points.mean(axis=1) / max(weight.sum(), 1e-12), float(weight.sum())


@kernel
def _longest(points, names):
    """`longest_reference`, joining segments that follow one another in the order of their ends' names."""
    order = np.argsort(names.ravel())
    parent = np.arange(len(names))
    for n in range(1, len(order)):
        a, b = order[n - 1], order[n]
        if names[a >> 1, a & 1] == names[b >> 1, b & 1]:
            parent[_find(parent, b >> 1)] = _find(parent, a >> 1)
    lengths, whole = np.zeros(len(names)), np.zeros(len(names))
    for s in range(len(names)):
        for i in range(3):
            lengths[s] += (points[s, 1, i] - points[s, 0, i]) ** 2
        lengths[s] = np.sqrt(lengths[s])
        whole[_find(parent, s)] += lengths[s]
    best, centre = np.argmax(whole), np.zeros(3)
    for s in range(len(names)):
        if _find(parent, s) == best:
            for i in range(3):
                centre[i] += lengths[s] * (points[s, 0, i] + points[s, 1, i]) / 2
    return centre / max(whole[best], 1e-12), whole[best]
