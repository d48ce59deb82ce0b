"""Curves around limbs as the paper finds them: by rays in two planes at a seed (paper section 4, fig. 2).

From a vertex a ray runs through the body along the inward normal of one of its quads, v - P0. Two planes hold that ray
and one of the quad's edges at v each. In both, ten lines through the middle of v - P0, 18 degrees apart, meet the
surface in 20 points; d is the difference of their greatest and least distance from their centre. The plane of the
smaller d runs around the limb. From the seed the curve goes on along the edge nearest to that plane; its neighbours the
other way are the next seeds, and each vertex is visited once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deformation.isocurves import IsoCurves
from deformation.kernel import kernel
from deformation.mesh import Mesh
from devices.errors import SixpointError
from devices.frame import frozen

LINES = 10
"""Through the middle, in each plane."""

_OFF_THE_SKIN = 1e-5
"""A ray starts so far under the surface, as a share of the mesh's diagonal."""

_TRIED = 200
"""Of a group of vertices so many at most are tried for its clearest seed."""

_ACROSS = np.sin(np.radians(45))
"""An edge that leaves the plane by more is no step around the limb."""


@dataclass(frozen=True, eq=False)
class Directions:
    """Which way around at each of some vertices.

    normals: (N, 2, 3) unit, of the planes of the quad's edges before and after each vertex; 0 where no ray came back.
    spreads: (N, 2) metres, the paper's d1 and d2; infinite where a line leaves the body.
    radii: (N, 2) metres, the 20 points' mean distance from their centre.
    """

    normals: NDArray[np.float64]
    spreads: NDArray[np.float64]
    radii: NDArray[np.float64]

    @property
    def around(self) -> NDArray[np.float64]:
        """(N, 3) the normals of the planes that run around, those of the smaller spread; 0 where both are infinite."""
        return self._chosen(np.argmin(self.spreads, axis=1))[0]

    def along(self, normals: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N, 3) as `around`, but the other plane where that lies nearer to a known one (N, 3), and its radii (N,)."""
        least = np.argmin(self.spreads, axis=1)
        near = np.abs(np.einsum("npi,ni->np", self.normals, normals))
        unlike = normals.any(axis=1) & (near[np.arange(len(near)), least] < _ACROSS)
        return self._chosen(np.where(unlike, np.argmax(near, axis=1), least))

    def _chosen(self, plane: NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rows = np.arange(len(plane))
        found = np.isfinite(self.spreads[rows, plane])
        return np.where(found[:, None], self.normals[rows, plane], 0.0), np.where(found, self.radii[rows, plane], 0.0)


class RayTest:
    """Rays through one mesh of quads, by Open3D. Raises SixpointError where that does not load."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._cast = _caster(mesh)
        self._start = _OFF_THE_SKIN * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        self._quad = np.full(len(mesh.vertices), -1, np.int64)
        for corner in range(4):
            self._quad[mesh.quads[:, corner]] = np.arange(len(mesh.quads))

    def has_quad(self, vertices: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(N,) whether each vertex is a corner of a quad."""
        return self._quad[vertices] >= 0

    def directions(self, seeds: NDArray[np.int32]) -> Directions:
        """The planes around the limbs at vertices (N,), which must be corners of quads."""
        vertices, quads = self._mesh.vertices, self._mesh.quads[self._quad[seeds]]
        corner = np.argmax(quads == seeds[:, None], axis=1)
        rows, start = np.arange(len(seeds)), vertices[seeds]
        after, before = (vertices[quads[rows, (corner + step) % 4]] - start for step in (1, 3))
        inward = _unit(-_quad_normals(vertices[quads]))
        through = self._hits(start + self._start * inward, inward)
        planes = [self._plane(start, through, edge) for edge in (before, after)]
        normals, spreads, radii = (np.stack(column, axis=1) for column in zip(*planes, strict=True))
        return Directions(frozen(np.nan_to_num(normals)), frozen(spreads), frozen(radii))

    def _plane(
        self, start: NDArray[np.float64], through: NDArray[np.float64], edge: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Normals (N, 3), spreads (N,) and mean radii (N,) of the planes of the ways through and edges."""
        normal = _unit(np.cross(through - start, edge))
        u = _unit(through - start)
        w = np.cross(normal, u)
        turn = np.pi * np.arange(LINES) / LINES
        turn = np.concatenate([turn, turn + np.pi])
        rays = np.cos(turn)[None, :, None] * u[:, None] + np.sin(turn)[None, :, None] * w[:, None]
        middle = np.repeat((start + through)[:, None] / 2, len(turn), axis=1)
        points = self._hits(middle.reshape(-1, 3), rays.reshape(-1, 3)).reshape(rays.shape)
        away = np.linalg.norm(points - points.mean(axis=1, keepdims=True), axis=2)
        spread = np.where(np.isfinite(away).all(axis=1), np.ptp(away, axis=1), np.inf)
        return normal, spread, away.mean(axis=1)

    def _hits(self, origins: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) where rays meet the surface; NaN for those that do not."""
        distance = self._cast(origins, directions)
        with np.errstate(invalid="ignore"):
            points = origins + distance[:, None] * directions
        points[~np.isfinite(distance)] = np.nan
        return points


def _caster(mesh: Mesh) -> Any:
    """Distances (N,) along rays: origins and directions (N, 3); infinite where nothing is met."""
    try:
        open3d: Any = import_module("open3d")
    except (ImportError, OSError) as error:
        raise SixpointError(f"the ray test needs Open3D, and it does not load: {str(error).splitlines()[0]}") from error
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    core = open3d.core
    scene.add_triangles(core.Tensor(mesh.vertices.astype(np.float32)), core.Tensor(mesh.triangulated.astype(np.uint32)))

    def cast(origins: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
        rays = np.concatenate([origins, directions], axis=1)
        sound = np.asarray(np.isfinite(rays).all(axis=1))
        rays = np.where(sound[:, None], rays, 0.0).astype(np.float32)
        distance = scene.cast_rays(core.Tensor(rays), nthreads=1)["t_hit"].numpy().astype(np.float64)
        return np.where(sound, distance, np.inf)

    return cast


def clearest_seeds(test: RayTest, groups: Sequence[NDArray[np.int64]]) -> NDArray[np.int32]:
    """(G',) the vertex of each group (N,) whose two spreads differ most as a ratio; none for groups without rays."""
    seeds = []
    for group in groups:
        tried = group[test.has_quad(group)]
        tried = tried[:: max(1, len(tried) // _TRIED)]
        spreads = test.directions(tried.astype(np.int32)).spreads
        sound = np.isfinite(spreads).all(axis=1) & (spreads.max(axis=1, initial=0) > 0)
        if sound.any():
            ratios = spreads[sound].min(axis=1) / spreads[sound].max(axis=1)
            seeds.append(int(tried[sound][np.argmin(ratios)]))
    return np.array(seeds, np.int32)


def ray_curves(mesh: Mesh, seeds: NDArray[np.int32], test: RayTest | None = None) -> IsoCurves:
    """The curves around limbs from seeds on limbs on, each vertex on one of them at most.

    Vertices without a plane, where the mesh is open, begin no curve. Raises SixpointError where Open3D does not load.
    """
    walker = _Walker(mesh, test or RayTest(mesh))
    left = walker.close(np.unique(np.asarray(seeds, np.int32)))
    while len(left):
        left = walker.close(np.concatenate([walker.open(left), left]))
    return _as_curves(mesh, walker.curves, walker.closed)


class _Walker:
    """Goes over a mesh from ring to ring, and remembers where it was."""

    def __init__(self, mesh: Mesh, test: RayTest) -> None:
        self._vertices, self._test = mesh.vertices, test
        self._first, self._neighbours = _edges(mesh.quads, len(mesh.vertices))
        self._visited = np.ones(len(mesh.vertices), np.bool_)
        self._visited[mesh.quads] = False
        self.curves: list[NDArray[np.int32]] = []
        self.closed: list[bool] = []

    def close(self, seeds: NDArray[np.int32]) -> NDArray[np.int32]:
        """Closed curves at the seeds, beside these, and so on; gives the seeds left, whose curves do not close."""
        waiting, planes = seeds, np.zeros((len(seeds), 3))
        left = np.zeros(len(self._visited), np.bool_)
        while len(waiting):
            found = []
            normals, radii = self._test.directions(waiting).along(planes)
            for seed, normal, radius in zip(waiting, normals, radii, strict=True):
                if self._visited[seed]:
                    continue
                curve, back = self._around(seed, normal, radius)
                if back:
                    self._keep(curve, back)
                    found.append((curve, normal))
                else:
                    self._visited[curve] = False
                    left[seed] = True
            waiting, planes = self._beside(found)
            fresh = ~left[waiting]
            waiting, planes = waiting[fresh], planes[fresh]
        return np.flatnonzero(left & ~self._visited).astype(np.int32)

    def open(self, seeds: NDArray[np.int32]) -> NDArray[np.int32]:
        """Curves at the seeds whether they close or not; gives the fresh vertices beside them."""
        found, directions = [], self._test.directions(seeds)
        normals, radii = directions.along(np.zeros((len(seeds), 3)))
        for seed, normal, radius in zip(seeds, normals, radii, strict=True):
            if not self._visited[seed]:
                curve, back = self._around(seed, normal, radius)
                self._keep(curve, back)
                found.append((curve, normal))
        return self._beside(found)[0]

    def _keep(self, curve: NDArray[np.int32], closed: bool) -> None:
        self.curves.append(curve)
        self.closed.append(closed)

    def _beside(
        self, found: list[tuple[NDArray[np.int32], NDArray[np.float64]]]
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """(N,) every fresh neighbour of some curves, and (N, 3) the normals of the curves they are beside."""
        fresh = [_fresh(curve, self._first, self._neighbours, self._visited) for curve, _ in found]
        if not sum(map(len, fresh)):
            return np.empty(0, np.int32), np.empty((0, 3))
        planes = np.repeat([normal for _, normal in found], [len(f) for f in fresh], axis=0)
        seeds, place = np.unique(np.concatenate(fresh), return_index=True)
        order = np.argsort(place)
        return seeds[order], planes[place[order]]

    def _around(self, seed: int, normal: NDArray[np.float64], radius: float) -> tuple[NDArray[np.int32], bool]:
        return _around(seed, normal, radius, self._vertices, self._first, self._neighbours, self._visited)


@kernel
def _fresh(curve, first, neighbours, visited):
    """The neighbours of a curve's vertices that are on none yet."""
    result = np.empty(8 * len(curve), np.int32)
    size = 0
    for v in curve:
        for n in range(first[v], first[v + 1]):
            if not visited[neighbours[n]] and size < len(result):
                result[size] = neighbours[n]
                size += 1
    return result[:size].copy()


@kernel
def _step(here, before, seed, count, normal, radius, vertices, first, neighbours, visited):
    """The neighbour whose edge is nearest to the plane, the seed again among them; -1 where none is a step around."""
    best, least = -1, _ACROSS
    for n in range(first[here], first[here + 1]):
        other = neighbours[n]
        if other == before or (visited[other] and not (other == seed and count > 2)):
            continue
        size, leaving, away = 0.0, 0.0, 0.0
        for i in range(3):
            way = vertices[other, i] - vertices[here, i]
            size += way * way
            leaving += way * normal[i]
            away += (vertices[other, i] - vertices[seed, i]) * normal[i]
        leaving = abs(leaving) / max(np.sqrt(size), 1e-30)
        if leaving < least and abs(away) <= radius:
            best, least = other, leaving
    return best


@kernel
def _around(seed, normal, radius, vertices, first, neighbours, visited):
    """The curve (n,) from a seed on near its plane, and whether it closes; where it does not, both ways from there."""
    path = np.empty(2 * len(visited) + 2, np.int32)
    visited[seed] = True
    middle = len(visited)
    path[middle] = seed
    low, high = middle, middle + 1
    for ahead in (True, False):
        here, before, count = seed, -1, 1
        while True:
            enough = count if ahead else 0
            step = _step(here, before, seed, enough, normal, radius, vertices, first, neighbours, visited)
            if step < 0:
                break
            if step == seed:
                return path[low:high].copy(), True
            visited[step] = True
            count += 1
            if ahead:
                path[high] = step
                high += 1
            else:
                low -= 1
                path[low] = step
            before, here = here, step
    return path[low:high].copy(), False


def _edges(quads: NDArray[np.int32], count: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The neighbours along edges of each vertex: those of v are `neighbours[first[v] : first[v + 1]]`."""
    ends = quads[:, [0, 1, 1, 2, 2, 3, 3, 0]].reshape(-1, 2).astype(np.int64)
    names = np.unique(np.concatenate([ends[:, 0] * count + ends[:, 1], ends[:, 1] * count + ends[:, 0]]))
    first = np.searchsorted(names // max(count, 1), np.arange(count + 1)).astype(np.int32)
    return first, (names % max(count, 1)).astype(np.int32)


def _as_curves(mesh: Mesh, curves: list[NDArray[np.int32]], closed: list[bool]) -> IsoCurves:
    """Curves (n,) of vertices with the sides of quads that lie on them."""
    sizes = np.array([len(curve) for curve in curves], np.int64)
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    vertices = np.concatenate([np.empty(0, np.int32), *curves])
    curve_of, place = np.full(len(mesh.vertices), -1), np.zeros(len(mesh.vertices), np.int64)
    curve_of[vertices] = np.repeat(np.arange(len(curves)), sizes)
    place[vertices] = np.arange(len(vertices)) - np.repeat(starts[:-1], sizes)
    a, b = mesh.quads.ravel(), np.roll(mesh.quads, -1, axis=1).ravel()
    own, apart = curve_of[a], np.abs(place[a] - place[b])
    back = np.array([*closed, False])
    around = (own >= 0) & (own == curve_of[b])
    around &= (apart == 1) | (back[own] & (apart == np.r_[sizes, 0][own] - 1))
    edges = np.where(around, own, -1).astype(np.int32)
    return IsoCurves(frozen(vertices), frozen(starts), frozen(np.array(closed, bool)), frozen(edges))


def _quad_normals(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) outward, of quads (N, 4, 3)."""
    return np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30)
