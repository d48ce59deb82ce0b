"""Quads out of triangles: most triangle meshes were quads before a program cut each in two."""

import numpy as np
from numpy.typing import NDArray

from deformation.kernel import kernel
from deformation.mesh import Mesh
from deformation.mesh_repair import same_places

_WORST_CORNER = np.radians(70)
"""A quad whose corners are farther than this from right angles is none."""

_WORST_FOLD = np.radians(60)
"""Nor is one whose halves are folded by more."""

_WRITTEN_TOGETHER = np.radians(25)
"""What it counts in a pair's favour that the file lists one right after the other, as programs do that cut a quad."""


def paired_quads(mesh: Mesh) -> tuple[Mesh, float]:
    """The mesh with its triangles joined in pairs, and the share of them that found a partner.

    Seams are welded: faces use the first vertex at each place. The pair whose corners are nearest to right angles and
    whose halves lie flattest joins first.
    """
    place = same_places(mesh.vertices)
    triangles = place[mesh.triangles]
    quads, partners = _candidates(triangles)
    together = np.abs(np.diff(partners, axis=1))[:, 0] == 1
    cost = _cost(mesh.vertices[quads]) - _WRITTEN_TOGETHER * together
    order = np.argsort(cost, kind="stable")
    chosen = _greedy(order[np.isfinite(cost[order])], partners, len(triangles))
    alone = np.ones(len(triangles), bool)
    alone[partners[chosen]] = False
    joined = np.concatenate([place[mesh.quads], quads[chosen]]).astype(np.int32)
    share = 1 - float(alone.mean()) if len(triangles) else 1.0
    return Mesh(mesh.vertices, joined, triangles[alone].astype(np.int32)), share


def _candidates(triangles: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(N, 4) the quads that two triangles across an edge make, and (N, 2) these triangles."""
    side = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    apex = np.concatenate([triangles[:, (k + 2) % 3] for k in range(3)])
    owner = np.tile(np.arange(len(triangles)), 3)
    name = np.sort(side, axis=1)
    order = np.lexsort((name[:, 1], name[:, 0]))
    same = (np.diff(name[order], axis=0) == 0).all(axis=1)
    # An edge of three faces or more is no place to join.
    lonely = np.r_[True, ~same[:-1]] & np.r_[~same[1:], True] & same if len(same) else same
    a, b = order[:-1][lonely], order[1:][lonely]
    facing = side[a, 0] == side[b, 1]
    a, b = a[facing], b[facing]
    return np.stack([apex[a], side[a, 0], apex[b], side[a, 1]], axis=1), np.stack([owner[a], owner[b]], axis=1)


def _cost(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) radians: the corner farthest from a right angle, and the fold, of quads (N, 4, 3); infinite for bad ones."""
    ahead = np.roll(corners, -1, axis=1) - corners
    ahead /= np.maximum(np.linalg.norm(ahead, axis=2, keepdims=True), 1e-12)
    cosine = -np.einsum("nki,nki->nk", ahead, np.roll(ahead, 1, axis=1))
    corner = np.abs(np.arccos(np.clip(cosine, -1, 1)) - np.pi / 2).max(axis=1)
    halves = [
        np.cross(corners[:, j] - corners[:, i], corners[:, k] - corners[:, i]) for i, j, k in ((0, 1, 3), (2, 3, 1))
    ]
    sizes = np.prod([np.linalg.norm(half, axis=1) for half in halves], axis=0)
    fold = np.arccos(np.clip(np.einsum("ni,ni->n", *halves) / np.maximum(sizes, 1e-20), -1, 1))
    bad = (corner > _WORST_CORNER) | (fold > _WORST_FOLD)
    return np.where(bad, np.inf, corner + fold)


@kernel
def _greedy(order, partners, count):
    """The candidates taken one after another, each triangle once."""
    free = np.ones(count, np.bool_)
    chosen = np.empty(len(order), np.int64)
    size = 0
    for candidate in order:
        a, b = partners[candidate, 0], partners[candidate, 1]
        if free[a] and free[b]:
            free[a] = free[b] = False
            chosen[size] = candidate
            size += 1
    return chosen[:size].copy()
