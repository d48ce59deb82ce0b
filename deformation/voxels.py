"""The inside of a surface as small voxels, joined where the surface does not come between them.

Rays along the three axes through all voxel centres are crossed with every triangle. The crossings give the winding
number of each centre (inside or not) and tell whether the surface leaves the body between two neighbouring centres:
two thighs that lie side by side stay apart although all their voxels touch.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from devices.frame import frozen

_JITTER = np.array([1.7e-6, -2.3e-6, 3.1e-6])
"""Shift of the rays, in voxels: keeps them off vertices that stand on round coordinates."""

_OPEN_SHARE = 0.01
"""The ways out may disagree on this share of the inside before the surface is taken to be open."""


@dataclass(frozen=True, eq=False)
class Voxels:
    """The voxels whose centres lie inside a surface.

    origin: (3,) metres, the low corner of voxel (0, 0, 0); size: metres, its edge; shape: voxels along x, y, z.
    solid: (N, 3) int32 indices of the inside voxels.
    links: (L, 2) int32 rows of `solid`: face neighbours that the surface does not separate.
    contacts: (M, 2) int32 (row of `solid`, triangle): the surface met first on the way to a face neighbour.
    closed: whether the surface encloses its inside without holes.
    """

    origin: NDArray[np.float64]
    size: float
    shape: tuple[int, int, int]
    solid: NDArray[np.int32]
    links: NDArray[np.int32]
    contacts: NDArray[np.int32]
    closed: bool

    @cached_property
    def body(self) -> NDArray[np.bool_]:
        """The inside and one voxel around it, on the whole grid: what a straight line through the body stays in."""
        filled = np.zeros(self.shape, bool)
        filled[tuple(self.solid.T)] = True
        return frozen(binary_dilation(filled))

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(...,) whether points (..., 3) metres lie in the body, to about a voxel."""
        index = np.clip(np.floor((points - self.origin) / self.size).astype(np.int64), 0, np.array(self.shape) - 1)
        return self.body[index[..., 0], index[..., 1], index[..., 2]]


@dataclass(frozen=True, eq=False)
class _Crossings:
    """Where rays along one axis meet triangles, in the order of the rays: between centre `low` and the next one.

    low: (K, 3) int voxel indices, -1 possible on the axis; rising: (K,) winding number gained when walking up the axis.
    """

    axis: int
    low: NDArray[np.int64]
    rising: NDArray[np.int64]
    triangle: NDArray[np.int64]


def voxelise(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    origin: NDArray[np.float64],
    size: float,
    shape: tuple[int, int, int],
) -> Voxels:
    """The inside voxels of a surface: vertices (V, 3) metres, triangles (F, 3), counter-clockwise seen from outside.

    A centre is inside where most of the six ways out of it along the axes say that the winding number is one or more.
    Where they disagree on over a hundredth of the inside the surface is open, or its faces are turned at random: then
    what a flood from outside does not reach is inside as well.
    """
    grid = (vertices - origin) / size - 0.5 + _JITTER
    crossings = [_crossings(grid, triangles, shape, axis) for axis in range(3)]
    windings = [_winding(c, shape) for c in crossings]
    votes = np.sum(
        [
            np.add(up >= 1, up - np.take(up, [-1], c.axis) >= 1, dtype=np.int8)
            for c, up in zip(crossings, windings, strict=True)
        ],
        axis=0,
    )
    inside = votes >= 4
    disputed = np.count_nonzero((votes > 0) & (votes < 6))
    closed = disputed <= _OPEN_SHARE * np.count_nonzero(inside)
    if not closed:
        inside |= _enclosed(crossings, shape)
    number = np.full(shape, -1, np.int32)
    number[inside] = np.arange(np.count_nonzero(inside), dtype=np.int32)
    links, contacts = [], []
    for crossing, winding in zip(crossings, windings, strict=True):
        blocked = _leaves_between(crossing, np.where(inside, np.maximum(winding, 1), winding), shape)
        links.append(_links(number, blocked, crossing.axis))
        contacts.append(_contacts(number, crossing, shape))
    return Voxels(
        frozen(np.array(origin)),
        size,
        shape,
        frozen(np.argwhere(inside).astype(np.int32)),
        frozen(np.concatenate(links)),
        frozen(np.concatenate(contacts)),
        bool(closed),
    )


def _crossings(
    grid: NDArray[np.float64], triangles: NDArray[np.int32], shape: tuple[int, int, int], axis: int
) -> _Crossings:
    """All meetings of the rays along `axis` with triangles; vertices in voxel units, centres on whole numbers."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    corner = grid[triangles]
    plane = corner[:, :, [b, c]]
    low = np.maximum(np.ceil(plane.min(axis=1)), 0).astype(np.int64)
    high = np.minimum(np.floor(plane.max(axis=1)), np.array([shape[b], shape[c]]) - 1).astype(np.int64)
    count = np.maximum(high - low + 1, 0)
    total = count[:, 0] * count[:, 1]
    face = np.repeat(np.arange(len(triangles)), total)
    nth = np.arange(len(face)) - np.repeat(np.cumsum(total) - total, total)
    ray = low[face] + np.stack([nth // np.maximum(count[face, 1], 1), nth % np.maximum(count[face, 1], 1)], axis=1)
    sides = [_side(plane[face, i], plane[face, (i + 1) % 3], ray) for i in range(3)]
    hit = (sides[0] == sides[1]) & (sides[1] == sides[2])
    face, ray, sign = face[hit], ray[hit], sides[0][hit]
    depth = _plane_depth(corner[face], ray, axis)
    order = np.lexsort((depth, ray[:, 1], ray[:, 0]))
    index = np.empty((len(face), 3), np.int64)
    index[:, axis] = np.clip(np.floor(depth), -1, shape[axis] - 1)
    index[:, b], index[:, c] = ray[:, 0], ray[:, 1]
    return _Crossings(axis, index[order], -sign[order], face[order])


def _side(start: NDArray[np.float64], end: NDArray[np.float64], point: NDArray[np.int64]) -> NDArray[np.int64]:
    """+1 left of the edge, -1 right of it. Both faces at an edge see the same rounding: one of them has the point."""
    swap = (end[:, 0] < start[:, 0]) | ((end[:, 0] == start[:, 0]) & (end[:, 1] < start[:, 1]))
    a, b = np.where(swap[:, None], end, start), np.where(swap[:, None], start, end)
    area = (b[:, 0] - a[:, 0]) * (point[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (point[:, 0] - a[:, 0])
    return np.where((area >= 0) != swap, 1, -1)


def _plane_depth(corner: NDArray[np.float64], ray: NDArray[np.int64], axis: int) -> NDArray[np.float64]:
    """Where on their axis the rays meet the planes of their triangles (K, 3, 3), kept within the triangles' extent."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    rise = normal[:, b] * (ray[:, 0] - corner[:, 0, b]) + normal[:, c] * (ray[:, 1] - corner[:, 0, c])
    steep = normal[:, axis]
    depth = corner[:, 0, axis] - np.divide(rise, steep, out=np.zeros_like(rise), where=steep != 0)
    return np.clip(depth, corner[:, :, axis].min(axis=1), corner[:, :, axis].max(axis=1))


def _winding(crossing: _Crossings, shape: tuple[int, int, int]) -> NDArray[np.int64]:
    """The winding number of every centre: the crossings below it on its ray, added up."""
    above = crossing.low.copy()
    above[:, crossing.axis] += 1
    kept = above[:, crossing.axis] < shape[crossing.axis]
    gain = np.zeros(shape, np.int64)
    np.add.at(gain, tuple(above[kept].T), crossing.rising[kept])
    return np.cumsum(gain, axis=crossing.axis)


def _crossed(crossing: _Crossings, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    """True at each centre whose way up the axis to the next centre meets the surface."""
    blocked = np.zeros(shape, bool)
    kept = crossing.low[:, crossing.axis] >= 0
    blocked[tuple(crossing.low[kept].T)] = True
    return blocked


def _leaves_between(crossing: _Crossings, winding: NDArray[np.int64], shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    """True at each centre whose way up the axis to the next centre leads outside in between."""
    kept = crossing.low[:, crossing.axis] >= 0
    low, rising = crossing.low[kept], crossing.rising[kept]
    first = np.ones(len(low), bool)
    first[1:] = (low[1:] != low[:-1]).any(axis=1)
    sums = np.cumsum(rising)
    group = np.cumsum(first) - 1
    before = (sums - rising)[first][group]
    level = winding[tuple(low.T)] + sums - before
    blocked = np.zeros(shape, bool)
    blocked[tuple(low[level < 1].T)] = True
    return blocked


def _links(number: NDArray[np.int32], blocked: NDArray[np.bool_], axis: int) -> NDArray[np.int32]:
    """Pairs of inside voxels that are neighbours on an axis with nothing between."""
    low = [slice(None)] * 3
    high = [slice(None)] * 3
    low[axis], high[axis] = slice(None, -1), slice(1, None)
    a, b, wall = number[tuple(low)], number[tuple(high)], blocked[tuple(low)]
    free = (a >= 0) & (b >= 0) & ~wall
    return np.stack([a[free], b[free]], axis=1)


def _contacts(number: NDArray[np.int32], crossing: _Crossings, shape: tuple[int, int, int]) -> NDArray[np.int32]:
    """(inside voxel, triangle) for the first surface each voxel meets up and down the axis."""
    low, triangle = crossing.low, crossing.triangle
    change = np.ones(len(low) + 1, bool)
    change[1:-1] = (low[1:] != low[:-1]).any(axis=1)
    up = low[change[:-1]]
    down = low[change[1:]].copy()
    down[:, crossing.axis] += 1
    pairs = []
    for voxel, face in ((up, triangle[change[:-1]]), (down, triangle[change[1:]])):
        within = (voxel[:, crossing.axis] >= 0) & (voxel[:, crossing.axis] < shape[crossing.axis])
        row = number[tuple(voxel[within].T)]
        pairs.append(np.stack([row, face[within]], axis=1)[row >= 0])
    return np.concatenate(pairs).astype(np.int32)


def _enclosed(crossings: list[_Crossings], shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    """What a flood from outside does not reach, the surface being a wall between voxel centres."""
    nx, ny, nz = (n + 2 for n in shape)
    number = np.arange(nx * ny * nz, dtype=np.int32).reshape(nx, ny, nz)
    padded = [_Crossings(c.axis, c.low + 1, c.rising, c.triangle) for c in crossings]
    pairs = np.concatenate([_links(number, _crossed(c, (nx, ny, nz)), c.axis) for c in padded])
    graph = coo_matrix((np.ones(len(pairs), np.int8), tuple(pairs.T)), shape=(number.size, number.size))
    label = connected_components(graph, directed=False)[1].reshape(nx, ny, nz)
    return (label != label[0, 0, 0])[1:-1, 1:-1, 1:-1]
