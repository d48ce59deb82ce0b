"""Iso-parametric curves of a quad mesh, and tubes of closed ones (paper section 4).

At a vertex of four quads the edge straight on is the one that shares no quad with the edge one comes by. Walking on so
until one is back, or at a vertex of another number of quads, gives the curves along which the mesh was modelled: each
edge belongs to one curve, each ordinary vertex to two. Closed curves of equal size side by side make a tube.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.kernel import kernel
from deformation.mesh import Mesh
from devices.frame import frozen

_LEAST_RINGS = 4
"""So many closed curves of a kind in a row are a tube."""


@dataclass(frozen=True, eq=False)
class IsoCurves:
    """Every iso-parametric curve of a mesh.

    vertices: (N,) int32 all curves' vertices, one curve after another, a closed one's first vertex not repeated;
    starts: (C + 1,) int32 where each begins. closed: (C,) bool. edges: (4 Q,) int32 the curve of each quad's sides.
    """

    vertices: NDArray[np.int32]
    starts: NDArray[np.int32]
    closed: NDArray[np.bool_]
    edges: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.closed)

    def curve(self, number: int) -> NDArray[np.int32]:
        """(n,) the vertices of one curve in order."""
        return self.vertices[self.starts[number] : self.starts[number + 1]]

    def only(self, numbers: NDArray[np.int32]) -> "IsoCurves":
        """Some of the curves, in that order; sides of quads on others have curve -1."""
        chosen = [self.curve(int(number)) for number in numbers]
        new = np.full(len(self) + 1, -1, np.int32)
        new[numbers] = np.arange(len(numbers))
        starts = np.cumsum([0, *map(len, chosen)], dtype=np.int32)
        vertices = np.concatenate([np.empty(0, np.int32), *chosen])
        return IsoCurves(frozen(vertices), frozen(starts), frozen(self.closed[numbers]), frozen(new[self.edges]))


@dataclass(frozen=True, eq=False)
class Tubes:
    """Chains of like closed curves: `curves[starts[t] : starts[t + 1]]` are tube t's, in order along it."""

    curves: NDArray[np.int32]
    starts: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.starts) - 1

    def tube(self, number: int) -> NDArray[np.int32]:
        """(n,) the curves of one tube in order."""
        return self.curves[self.starts[number] : self.starts[number + 1]]


def iso_curves(mesh: Mesh) -> IsoCurves:
    """All curves of the quads of a mesh; its triangles are walls where curves end.

    Side k of quad q, from its corner k to the next, is number 4 q + k in `edges`.
    """
    twins = _twins(mesh.quads, len(mesh.vertices))
    ordinary = _ordinary(mesh.quads, mesh.triangles, twins, len(mesh.vertices))
    return IsoCurves(*(frozen(a) for a in _walk(mesh.quads, twins, ordinary)))


def tubes(mesh: Mesh, curves: IsoCurves, least: int = _LEAST_RINGS) -> Tubes:
    """The tubes of at least `least` closed curves."""
    after = _neighbours(mesh.quads, curves.edges, curves.starts, curves.closed)
    return Tubes(*(frozen(a) for a in _chains(after, least)))


@kernel
def _twins(quads, count):
    """(4 Q,) the side of another quad along each side, -1 where none or more than one is."""
    first = np.zeros(count + 1, np.int32)
    sides = 4 * len(quads)
    for side in range(sides):
        a, b = quads[side >> 2, side & 3], quads[side >> 2, (side + 1) & 3]
        first[min(a, b) + 1] += 1
    for vertex in range(count):
        first[vertex + 1] += first[vertex]
    fill = first.copy()
    listed = np.empty(sides, np.int32)
    for side in range(sides):
        a, b = quads[side >> 2, side & 3], quads[side >> 2, (side + 1) & 3]
        low = min(a, b)
        listed[fill[low]] = side
        fill[low] += 1
    twins = np.full(sides, -1, np.int32)
    for vertex in range(count):
        for n in range(first[vertex], first[vertex + 1]):
            side = listed[n]
            far = max(quads[side >> 2, side & 3], quads[side >> 2, (side + 1) & 3])
            found = 0
            for m in range(first[vertex], first[vertex + 1]):
                other = listed[m]
                if m != n and max(quads[other >> 2, other & 3], quads[other >> 2, (other + 1) & 3]) == far:
                    found += 1
                    twins[side] = other
            if found != 1:
                twins[side] = -1
    for side in range(sides):
        # Faces that run an edge the same way are no neighbours to walk between.
        if twins[side] >= 0 and quads[twins[side] >> 2, twins[side] & 3] == quads[side >> 2, side & 3]:
            twins[side] = -1
    return twins


@kernel
def _ordinary(quads, triangles, twins, count):
    """(V,) whether a vertex has four quads around it and nothing else."""
    faces = np.zeros(count, np.int32)
    wall = np.zeros(count, np.bool_)
    for q in range(len(quads)):
        for k in range(4):
            faces[quads[q, k]] += 1
            if twins[4 * q + k] < 0:
                wall[quads[q, k]] = True
                wall[quads[q, (k + 1) & 3]] = True
    for t in range(len(triangles)):
        for k in range(3):
            wall[triangles[t, k]] = True
    return (faces == 4) & ~wall


@kernel
def _next_side(side):
    return (side & ~3) | ((side + 1) & 3)


@kernel
def _walk(quads, twins, ordinary):
    """Follows each edge both ways; returns vertices, starts, closed and the sides' curves of `IsoCurves`."""
    sides = 4 * len(quads)
    edges = np.full(sides, -1, np.int32)
    vertices = np.empty(2 * sides, np.int32)
    starts = np.empty(sides + 1, np.int32)
    closed = np.empty(sides, np.bool_)
    count = end = 0
    starts[0] = 0
    for seed in range(sides):
        if edges[seed] >= 0:
            continue
        side, back = seed, False
        # Back to where the curve begins, or once around it.
        while True:
            origin = quads[side >> 2, side & 3]
            if not ordinary[origin]:
                break
            before = twins[(side & ~3) | ((side + 3) & 3)]
            before = (before & ~3) | ((before + 3) & 3)
            if before == seed or edges[before] >= 0:
                back = before == seed
                break
            side = before
        begin = side
        vertices[end] = quads[side >> 2, side & 3]
        end += 1
        while True:
            edges[side] = count
            if twins[side] >= 0:
                edges[twins[side]] = count
            ahead = quads[side >> 2, (side + 1) & 3]
            if not ordinary[ahead]:
                vertices[end] = ahead
                end += 1
                break
            side = _next_side(twins[_next_side(side)])
            if side == begin or edges[side] >= 0:
                if side != begin:
                    vertices[end] = ahead
                    end += 1
                break
            vertices[end] = ahead
            end += 1
        closed[count] = back
        count += 1
        starts[count] = end
    return vertices[:end].copy(), starts[: count + 1].copy(), closed[:count].copy(), edges


@kernel
def _neighbours(quads, edges, starts, closed):
    """(C, 2) the closed curves of equal size that lie side by side with each closed one, -1 for none."""
    after = np.full((len(closed), 2), -1, np.int32)
    times = np.zeros((len(closed), 2), np.int32)
    for side in range(len(edges)):
        curve = edges[side]
        opposite = edges[(side & ~3) | ((side + 2) & 3)]
        if not closed[curve] or not closed[opposite] or curve == opposite:
            continue
        if starts[curve + 1] - starts[curve] != starts[opposite + 1] - starts[opposite]:
            continue
        for slot in range(2):
            if after[curve, slot] < 0 or after[curve, slot] == opposite:
                after[curve, slot] = opposite
                times[curve, slot] += 1
                break
    for curve in range(len(closed)):
        for slot in range(2):
            # Side by side means all along.
            if times[curve, slot] != starts[curve + 1] - starts[curve]:
                after[curve, slot] = -1
    return after


@kernel
def _chains(after, least):
    """Follows neighbours from a free end, or around where there is none."""
    used = np.zeros(len(after), np.bool_)
    curves = np.empty(len(after), np.int32)
    starts = np.zeros(len(after) + 1, np.int32)
    count = end = 0
    for ends_only in (True, False):
        for seed in range(len(after)):
            if used[seed] or (after[seed, 0] < 0 and after[seed, 1] < 0):
                continue
            if ends_only and after[seed, 0] >= 0 and after[seed, 1] >= 0:
                continue
            begin, curve = end, seed
            while curve >= 0 and not used[curve]:
                used[curve] = True
                curves[end] = curve
                end += 1
                step = after[curve, 0]
                if step < 0 or used[step]:
                    step = after[curve, 1]
                curve = step
            if end - begin < least:
                end = begin
                continue
            count += 1
            starts[count] = end
    return curves[:end].copy(), starts[: count + 1].copy()
