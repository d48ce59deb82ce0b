"""Which curves of a mesh bend as its skin, and how all of the skin takes part.

Rings of tubes run around limbs. What lies between them (the trunk, shoulders, hips, hands, face) is crossed by open
curves with both ends fixed; what they do is carried on to every vertex, ends and junctions among them, by the
smoothest field that agrees with the rings and follows the open curves, and dies out away from both.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import splu

from deformation.curve_skeleton import tube_rings
from deformation.isocurves import IsoCurves, Tubes, iso_curves, tubes
from deformation.isocurves_pairing import paired_quads
from deformation.mesh import Mesh
from deformation.mesh_repair import same_places
from devices.frame import frozen

_ROUND = 1.2
"""Tubes of rings less round than that run along a limb, not around it: an ellipse of 4 to 1 has 1.2."""

_FADING = 4
"""Rings over which the lag fades out towards a tube's end."""

_SHORTEST = 5
"""An open curve of fewer vertices has none that could bend."""

_FOLLOWED_M = 0.02
"""How far from an open curve its motion is followed closely."""

_DYING_M = 0.15
"""Away from all curves motion dies out over such a way."""


@dataclass(frozen=True, eq=False)
class WholeSkin:
    """The curves of a whole mesh and how their lag becomes the skin's.

    curves: rings around limbs first, then the others, which may cross each other. rings: how many.
    spread: from displacements (N, 3) metres at the curves' vertices to (V, 3) metres.
    """

    curves: IsoCurves
    rings: int
    spread: Callable[[NDArray[np.float64]], NDArray[np.float64]]


def skin_curves(mesh: Mesh) -> tuple[IsoCurves, NDArray[np.float64]]:
    """The rings to bend, and (V,) how much of its lag each vertex shows, 0 to 1.

    These are the rings of tubes, fading out over the last few towards a tube's end; every curve where there are none.
    A curve that runs on from an arm over the trunk into a leg bends with the skeleton, not as skin does; it is known by
    the shorter rings that cross it. Triangles that pair are taken as quads.
    """
    curves, chains = _curves(mesh)
    shown, found = np.zeros(len(mesh.vertices)), []
    for tube in round_tubes(mesh, curves, chains):
        from_end = 1 + np.minimum(np.arange(len(tube)), np.arange(len(tube))[::-1])
        for ring, share in zip(tube, np.minimum(from_end / _FADING, 1.0), strict=True):
            shown[curves.curve(int(ring))] = share
        found.append(tube)
    if not found:
        return curves, np.ones(len(mesh.vertices))
    return curves.only(np.concatenate(found)), shown


def whole_skin(mesh: Mesh) -> WholeSkin:
    """All curves that bend as skin, and the field that carries their lag to every vertex of the mesh."""
    curves, chains = _curves(mesh)
    around = np.concatenate([np.empty(0, np.int32), *round_tubes(mesh, curves, chains)]).astype(np.int32)
    on_ring = np.zeros(len(mesh.vertices), bool)
    rings = [curves.curve(int(number)) for number in around]
    on_ring[np.concatenate([np.empty(0, np.int32), *rings])] = True
    others = np.setdiff1d(np.arange(len(curves)), around)
    runs = [run for number in others for run in _runs(curves, int(number), on_ring)]
    longest = max((len(ring) for ring in rings), default=len(mesh.vertices))
    runs = [(run, closed) for run, closed in runs if _SHORTEST <= len(run) <= longest]
    members = [*rings, *(run for run, _ in runs)]
    starts = np.cumsum([0, *map(len, members)]).astype(np.int32)
    closed = np.array([True] * len(rings) + [closed for _, closed in runs], bool)
    vertices = np.concatenate([np.empty(0, np.int32), *members]).astype(np.int32)
    chosen = IsoCurves(frozen(vertices), frozen(starts), frozen(closed), frozen(np.empty(0, np.int32)))
    return WholeSkin(chosen, len(rings), _spreading(mesh, chosen, on_ring))


def round_tubes(mesh: Mesh, curves: IsoCurves, chains: Tubes) -> list[NDArray[np.int32]]:
    """The tubes (n,) that run around limbs: their rings are round, and few shorter ones cross them."""
    girths = tube_rings(mesh.vertices, curves, chains).girths
    shortest = np.full(len(mesh.vertices), np.inf)
    for ring, girth in zip(chains.curves, girths, strict=True):
        members = curves.curve(int(ring))
        shortest[members] = np.minimum(shortest[members], girth)
    found = []
    for number in range(len(chains)):
        tube, girth = chains.tube(number), girths[chains.starts[number] : chains.starts[number + 1]]
        own = [curves.curve(int(ring)) for ring in tube]
        crossed = [shortest[ring] < size for ring, size in zip(own, girth, strict=True)]
        round_enough = np.median([_spread(mesh.vertices[ring]) for ring in own]) < _ROUND
        if round_enough and np.concatenate(crossed).mean() < 0.5:
            found.append(tube)
    return found


def _curves(mesh: Mesh) -> tuple[IsoCurves, Tubes]:
    quads = mesh if len(mesh.quads) else paired_quads(mesh)[0]
    curves = iso_curves(quads)
    return curves, tubes(quads, curves)


def _spread(ring: NDArray[np.float64]) -> float:
    """How far a ring (n, 3) is from round: the difference of its farthest and nearest point over their mean distance.

    The paper's measure of which direction runs around a limb (its fig. 2).
    """
    away = np.linalg.norm(ring - ring.mean(axis=0), axis=1)
    return float(np.ptp(away) / max(float(away.mean()), 1e-12))


def _runs(curves: IsoCurves, number: int, on_ring: NDArray[np.bool_]) -> list[tuple[NDArray[np.int32], bool]]:
    """The stretches (n,) of a curve between the rings that it crosses, without the rings' own vertices.

    Each with whether it is closed, as a curve is that crosses no ring and was.
    """
    members = curves.curve(number)
    cuts = np.flatnonzero(on_ring[members])
    if not len(cuts):
        return [(members, bool(curves.closed[number]))]
    if curves.closed[number]:
        members = np.roll(members, -cuts[0])
    return [(part[~on_ring[part]], False) for part in np.split(members, np.flatnonzero(on_ring[members]))]


def _spreading(
    mesh: Mesh, curves: IsoCurves, on_ring: NDArray[np.bool_]
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Solves L e + a (e - e_curve) + b e = 0 for the places off the rings, e given on these."""
    size = len(mesh.vertices)
    place = same_places(mesh.vertices)
    laplacian, areas = _laplacian(mesh, place)
    known, open_ones = np.zeros(size, bool), np.zeros(size, bool)
    known[place[on_ring]] = True
    open_ones[place[curves.vertices]] = True
    open_ones &= ~known
    free = np.flatnonzero((place == np.arange(size)) & ~known)
    given = np.flatnonzero(known)
    follow = areas / _FOLLOWED_M**2 * open_ones
    system = laplacian + diags(follow + areas / _DYING_M**2 + 1e-12)
    factor = splu(csc_matrix(system[free][:, free]))
    coupling = laplacian[free][:, given]
    on_curves = place[curves.vertices]
    count = np.maximum(np.bincount(on_curves, minlength=size), 1)

    def spread(lag: NDArray[np.float64]) -> NDArray[np.float64]:
        means = np.stack([np.bincount(on_curves, lag[:, i], size) for i in range(3)], axis=1) / count[:, None]
        field = np.zeros((size, 3))
        field[given] = means[given]
        field[free] = factor.solve(follow[free, None] * means[free] - coupling @ means[given])
        return field[place]

    return spread


def _laplacian(mesh: Mesh, place: NDArray[np.int64]) -> tuple[csc_matrix, NDArray[np.float64]]:
    """(V, V) cotangent weights, none below 0, and (V,) square metres around each vertex, seams welded."""
    triangles, size = place[mesh.triangulated], len(mesh.vertices)
    corners = mesh.vertices[triangles]
    rows, columns, weights, areas = [], [], [], np.zeros(size)
    for k in range(3):
        u, v = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        double = np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-14)
        rows.append(triangles[:, (k + 1) % 3])
        columns.append(triangles[:, (k + 2) % 3])
        weights.append(np.clip(np.einsum("ni,ni->n", u, v) / double, 1e-3, 50.0) / 2)
        areas += np.bincount(triangles[:, k], double / 6, size)
    i, j, w = np.concatenate(rows), np.concatenate(columns), np.concatenate(weights)
    half = coo_matrix((np.r_[w, w], (np.r_[i, j], np.r_[j, i])), shape=(size, size)).tocsc()
    return csc_matrix(diags(np.asarray(half.sum(axis=1)).ravel()) - half), areas
