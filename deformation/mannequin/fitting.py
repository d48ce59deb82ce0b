"""From the figure of blocks to the mesh: faces divided, vertices spread and laid onto the body's surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from deformation.mannequin.cage import Corner, Face
from deformation.mannequin.field import Field, project


@dataclass(frozen=True, eq=False)
class Patchwork:
    """Divided faces. vertices: (V, 3) metres; quads: (V - 2, 4); face: (V - 2,) the face each quad came from."""

    vertices: NDArray[np.float64]
    quads: NDArray[np.int32]
    face: NDArray[np.int32]


def divide(faces: list[Face], positions: dict[Corner, NDArray[np.float64]], counts: dict[str, int]) -> Patchwork:
    """Each face as an even grid with `counts` quads a side, neighbours sharing the vertices of their seam."""
    places: dict[object, int] = {}
    vertices: list[NDArray[np.float64]] = []
    quads, origin = [], []
    for number, face in enumerate(faces):
        n, m = (counts[name] for name in face.divisions)
        corners = np.array([positions[corner] for corner in face.corners])
        grid = np.empty((n + 1, m + 1), np.int32)
        for s in range(n + 1):
            for t in range(m + 1):
                key = _place(face, number, s, t, n, m)
                if key not in places:
                    places[key] = len(vertices)
                    vertices.append(_bilinear(corners, s / n, t / m))
                grid[s, t] = places[key]
        cells = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
        quads.append(cells)
        origin.append(np.full(len(cells), number, np.int32))
    return Patchwork(np.array(vertices), np.concatenate(quads), np.concatenate(origin))


def _bilinear(corners: NDArray[np.float64], s: float, t: float) -> NDArray[np.float64]:
    a, b, c, d = corners
    return (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * d + s * c)


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


def relax(
    vertices: NDArray[np.float64], quads: NDArray[np.int32], field: Field, rounds: int, share: float = 0.6
) -> NDArray[np.float64]:
    """Vertices (V, 3) spread evenly along the surface of `field`: each round moves them towards their neighbours' mean,
    then back onto the surface."""
    mean = neighbour_mean(quads, len(vertices))
    for _ in range(rounds):
        vertices = project(field, vertices + share * (mean @ vertices - vertices))
    return project(field, vertices, steps=3)


def neighbour_mean(quads: NDArray[np.int32], count: int) -> csr_array:
    """(V, V) sparse: the mean over the vertices that share an edge."""
    a, b = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2).T
    near = csr_array(coo_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(count, count)))
    near.data[:] = 1
    return csr_array(diags_array(1 / np.maximum(near.sum(axis=1), 1)) @ near)
