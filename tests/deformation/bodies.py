"""Small bodies with known properties, for the tests of lattice and skinning."""

import numpy as np
from numpy.typing import NDArray

from deformation.mesh import Mesh, all_quads
from reconstruction.skeleton import Skeleton


def box(low: tuple[float, float, float], high: tuple[float, float, float], pieces: int = 4) -> Mesh:
    """A closed box of `pieces` x `pieces` quads a side, faces outward."""
    points: dict[tuple[int, int, int], int] = {}
    quads = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        for end in (0, pieces):
            for i in range(pieces):
                for j in range(pieces):
                    corners = []
                    for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        key = [0, 0, 0]
                        key[axis], key[b], key[c] = end, i + di, j + dj
                        corners.append(points.setdefault((key[0], key[1], key[2]), len(points)))
                    quads.append(corners if end else corners[::-1])
    grid = np.array(list(points)) / pieces
    return all_quads(np.array(low) + grid * (np.array(high) - np.array(low)), np.array(quads, np.int32))


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one, unconnected."""
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    quads = [m.quads + start for m, start in zip(meshes, starts, strict=True)]
    return all_quads(np.concatenate([m.vertices for m in meshes]), np.concatenate(quads))


def chain(*points: tuple[float, float, float]) -> tuple[Skeleton, NDArray[np.float64]]:
    """A skeleton of joints one after another, the last an end site, and its bind (J, 4, 4)."""
    positions = np.array(points, float)
    names = tuple([f"joint{i}" for i in range(len(points) - 1)] + ["joint_end"])
    offsets = np.diff(positions, axis=0, prepend=np.zeros((1, 3)))
    return Skeleton(names, np.arange(-1, len(points) - 1, dtype=np.int32), offsets), at(positions)


def at(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(J, 4, 4) unturned transforms at positions (J, 3)."""
    transforms = np.tile(np.eye(4), (len(positions), 1, 1))
    transforms[:, :3, 3] = positions
    return transforms


def two_legs(gap: float = 0.01) -> tuple[Mesh, Skeleton, NDArray[np.float64]]:
    """A trunk on two legs, a narrow gap between them, as one closed mesh with its skeleton and bind.

    The trunk is x in [-0.15, 0.15], y in [0, 0.3]; the legs reach down to y = -0.5.
    """
    half, wide, deep = gap / 2, 0.15, 0.07
    columns = np.array([-wide, -(wide + half) / 2, -half, half, (wide + half) / 2, wide])
    rows = np.linspace(-0.5, 0.3, 17)
    floor = int(np.searchsorted(rows, -1e-9))
    solid = np.ones((5, 16), bool)
    solid[2, :floor] = False
    points: dict[tuple[int, int, int], int] = {}
    quads = []

    def quad(*keys: tuple[int, int, int]) -> None:
        quads.append([points.setdefault(key, len(points)) for key in keys])

    for i, j in np.argwhere(solid):
        i, j = int(i), int(j)
        quad((i, j, 1), (i + 1, j, 1), (i + 1, j + 1, 1), (i, j + 1, 1))
        quad((i, j, 0), (i, j + 1, 0), (i + 1, j + 1, 0), (i + 1, j, 0))
        if i == 0 or not solid[i - 1, j]:
            quad((i, j, 0), (i, j, 1), (i, j + 1, 1), (i, j + 1, 0))
        if i == 4 or not solid[i + 1, j]:
            quad((i + 1, j, 0), (i + 1, j + 1, 0), (i + 1, j + 1, 1), (i + 1, j, 1))
        if j == 0 or not solid[i, j - 1]:
            quad((i, j, 0), (i + 1, j, 0), (i + 1, j, 1), (i, j, 1))
        if j == 15:
            quad((i, j + 1, 0), (i, j + 1, 1), (i + 1, j + 1, 1), (i + 1, j + 1, 0))
    vertices = np.array([[columns[i], rows[j], (2 * k - 1) * deep] for i, j, k in points])
    legs = [[side, height, 0] for side in (0.08, -0.08) for height in (0, -0.25, -0.5)]
    places = np.array([[0, 0.05, 0], [0, 0.3, 0], *legs])
    parents = np.array([-1, 0, 0, 2, 3, 0, 5, 6], np.int32)
    names = ("hips", "hips_end", "thigh_l", "shin_l", "shin_l_end", "thigh_r", "shin_r", "shin_r_end")
    offsets = places - np.where(parents[:, None] >= 0, places[parents], 0)
    return all_quads(vertices, np.array(quads, np.int32)), Skeleton(names, parents, offsets), at(places)
