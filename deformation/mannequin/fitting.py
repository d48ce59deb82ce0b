"""From the figure of blocks to the mesh: faces divided, vertices spread and laid onto the body's surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from deformation.mannequin.cage import Corner, Face
from deformation.mannequin.field import Field, project

_SHARE = 0.6
"""Of the way to its neighbours' mean that a vertex goes in a round."""


_LEAST_FACING = -0.2
"""Cosine between a quad's corner and the surface below which it counts as folded."""


@dataclass(frozen=True, eq=False)
class Patchwork:
    """Divided faces. vertices: (V, 3) metres; grids: one (n + 1, m + 1) array of vertex indices a face."""

    faces: tuple[Face, ...]
    vertices: NDArray[np.float64]
    grids: tuple[NDArray[np.int32], ...]

    def quads(self) -> NDArray[np.int32]:
        """(V - 2, 4) vertex indices, face after face."""
        cells = [np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=-1) for g in self.grids]
        return np.concatenate([cell.reshape(-1, 4) for cell in cells])

    def shapes(self) -> list[NDArray[np.float64]]:
        """Each face's grid as (n + 1, m + 1, 3) metres."""
        return [self.vertices[grid] for grid in self.grids]

    def in_parts(self, parts: tuple[str, ...]) -> NDArray[np.bool_]:
        """(V,) whether a vertex is on a face of one of these parts."""
        member = np.zeros(len(self.vertices), bool)
        for face, grid in zip(self.faces, self.grids, strict=True):
            member[grid] |= face.part in parts
        return member


def corner_grids(faces: list[Face], positions: dict[Corner, NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Each face undivided: (2, 2, 3) metres."""
    return [
        np.array([[positions[a], positions[d]], [positions[b], positions[c]]])
        for a, b, c, d in (f.corners for f in faces)
    ]


def divide(faces: list[Face], shapes: list[NDArray[np.float64]], counts: dict[str, int]) -> Patchwork:
    """Each face as a grid with `counts` quads a side, neighbours sharing the vertices of their seam.

    shapes: for each face (A, B, 3) metres, a grid of any size whose points lie evenly over it; read bilinearly.
    """
    places: dict[object, int] = {}
    vertices: list[NDArray[np.float64]] = []
    grids = []
    for number, (face, shape) in enumerate(zip(faces, shapes, strict=True)):
        n, m = (counts[name] for name in face.divisions)
        points = _resampled(shape, n, m)
        grid = np.empty((n + 1, m + 1), np.int32)
        for s, t in np.ndindex(grid.shape):
            key = _place(face, number, s, t, n, m)
            if key not in places:
                places[key] = len(vertices)
                vertices.append(points[s, t])
            grid[s, t] = places[key]
        grids.append(grid)
    return Patchwork(tuple(faces), np.array(vertices), tuple(grids))


def _resampled(shape: NDArray[np.float64], n: int, m: int) -> NDArray[np.float64]:
    """(A, B, 3) read bilinearly at (n + 1, m + 1) even places."""
    for axis, count in ((0, n), (1, m)):
        place = np.linspace(0, shape.shape[axis] - 1, count + 1)
        low = np.minimum(place.astype(int), shape.shape[axis] - 2)
        share = np.expand_dims(place - low, (1, 2) if axis == 0 else (0, 2))
        shape = np.take(shape, low, axis) * (1 - share) + np.take(shape, low + 1, axis) * share
    return shape


def _place(face: Face, number: int, s: int, t: int, n: int, m: int) -> object:
    """What two faces agree on: a corner's name, a step along an edge between two corners, or a spot inside one face."""
    a, b, c, d = face.corners
    corner = {(0, 0): a, (n, 0): b, (n, m): c, (0, m): d}.get((s, t))
    if corner is not None:
        return corner
    if t in (0, m):
        return _step((a, b) if t == 0 else (d, c), s, n)
    if s in (0, n):
        return _step((a, d) if s == 0 else (b, c), t, m)
    return number, s, t


def _step(edge: tuple[Corner, Corner], step: int, count: int) -> object:
    low, high = sorted(edge, key=repr)
    return (low, high, step if low == edge[0] else count - step)


def relax(patches: Patchwork, field: Field, rounds: int, still: tuple[str, ...] = ()) -> Patchwork:
    """The vertices spread evenly along the surface of `field`.

    Each round moves them towards their neighbours' mean, but only along the surface (from inside, Newton's step would
    push a nose's vertices out at its sides), then back onto it. Parts in `still` stay as they are.
    """
    moving = ~patches.in_parts(still)
    vertices = patches.vertices.copy()
    vertices[moving], normals = project(field, vertices[moving])
    mean = _neighbour_mean(patches.quads(), len(vertices))
    for _ in range(rounds):
        step = _SHARE * (mean @ vertices - vertices)[moving]
        step -= np.einsum("ij,ij->i", step, normals)[:, None] * normals
        vertices[moving], normals = project(field, vertices[moving] + step)
    vertices[moving], _ = project(field, vertices[moving])
    return Patchwork(patches.faces, vertices, patches.grids)


def unfold(patches: Patchwork, field: Field, parts: tuple[str, ...], rounds: int = 12) -> Patchwork:
    """Vertices of `parts` at quads that look against the surface (in narrow webs) smoothed until none does."""
    vertices, quads = patches.vertices.copy(), patches.quads()
    mean = _neighbour_mean(quads, len(vertices))
    quads = quads[patches.in_parts(parts)[quads].all(axis=1)]
    normals = np.zeros_like(vertices)
    near = np.unique(quads)
    normals[near] = project(field, vertices[near])[1]
    for _ in range(rounds):
        folded = np.unique(quads[_against(vertices, quads, normals)])
        if not len(folded):
            break
        around = np.unique(mean[folded].indices)
        vertices[around] += _SHARE * ((mean @ vertices)[around] - vertices[around])
    return Patchwork(patches.faces, vertices, patches.grids)


def _against(
    vertices: NDArray[np.float64], quads: NDArray[np.int32], normals: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(Q,) whether a quad has a corner that turns away from the surface's normal (V, 3) there."""
    corners = vertices[quads]
    before, after = np.roll(corners, 1, axis=1) - corners, np.roll(corners, -1, axis=1) - corners
    turn = np.cross(after, before)
    turn /= np.maximum(np.linalg.norm(turn, axis=-1, keepdims=True), 1e-12)
    return (np.einsum("qci,qci->qc", turn, normals[quads]) < _LEAST_FACING).any(axis=1)


def _neighbour_mean(quads: NDArray[np.int32], count: int) -> csr_array:
    """(V, V) sparse: the mean over the vertices that share an edge."""
    a, b = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2).T
    near = csr_array(coo_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(count, count)))
    near.data[:] = 1
    return csr_array(diags_array(1 / np.maximum(near.sum(axis=1), 1)) @ near)
