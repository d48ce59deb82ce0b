"""The way from one pose to another that neither shrinks nor shears what only turns.

Vertices on straight ways shorten a bending limb. Here each triangle turns and stretches evenly, by the polar parts of
its change, and the vertices are those whose triangles come nearest to that (Alexa et al. 2000; Xu et al. 2005).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from deformation.mesh import Mesh

_LEAST_AREA = 1e-14


def turning_way(mesh: Mesh, end: NDArray[np.float64]) -> Callable[[float], NDArray[np.float64]]:
    """Shapes (V, 3) metres by the share of the way, 0 to 1, from the mesh's own vertices to `end` (V, 3).

    Where a triangle turns by more than half a circle it goes the short way round.
    """
    start = mesh.vertices
    used, triangles = np.unique(mesh.triangulated, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    first, last = _frames(start[used][triangles]), _frames(end[used][triangles])
    fair = np.abs(np.linalg.det(first)) > _LEAST_AREA
    first, last, triangles = first[fair], last[fair], triangles[fair]
    u, sizes, v = np.linalg.svd(last @ np.linalg.inv(first))
    # A frame holds the normal, so that no triangle is mirrored.
    turn = Rotation.from_matrix(u @ v).as_rotvec()
    stretch = np.einsum("fji,fj,fjk->fik", v, sizes, v)
    weights = np.linalg.norm(np.cross(first[:, :, 0], first[:, :, 1]), axis=1)
    edges, laplacian = _gradient(triangles, len(used), weights)
    moved = np.linalg.norm(end[used] - start[used], axis=1)
    still = 1 / (moved + 0.02 * moved.max() + 1e-9) ** 2
    still /= still.sum()
    factor = splu((laplacian + csr_matrix(([1e-9], ([0], [0])), laplacian.shape)).tocsc())

    def at(share: float) -> NDArray[np.float64]:
        change = Rotation.from_rotvec(share * turn).as_matrix() @ ((1 - share) * np.eye(3) + share * stretch)
        sides = np.einsum("fij,fjk->fki", change, _sides_of(first))
        solved = factor.solve(edges.T @ (np.repeat(weights, 3)[:, None] * sides.reshape(-1, 3)))
        straight = (1 - share) * start + share * end
        result = straight.copy()
        result[used] = solved + still @ (straight[used] - solved)
        return result

    return at


def _frames(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(F, 3, 3) columns: two sides of each triangle (F, 3, 3) and its normal, as long as a side."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(a, b)
    size = np.sqrt(np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20))
    return np.stack([a, b, normal / size], axis=2)


def _sides_of(frames: NDArray[np.float64]) -> NDArray[np.float64]:
    """(F, 3, 3) columns: the three sides in turn."""
    a, b = frames[:, :, 0], frames[:, :, 1]
    return np.stack([a, b - a, -b], axis=2)


def _gradient(triangles: NDArray[np.intp], size: int, weights: NDArray[np.float64]) -> tuple[csr_matrix, csr_matrix]:
    """(3 F, V) each side's end less its start, and the (V, V) normal matrix under the triangles' weights."""
    rows = np.arange(3 * len(triangles))
    ends = np.roll(triangles, -1, axis=1).ravel()
    ones = np.ones(len(rows))
    columns = np.concatenate([ends, triangles.ravel()])
    edges = csr_matrix(coo_matrix((np.r_[ones, -ones], (np.r_[rows, rows], columns)), shape=(len(rows), size)))
    weighted = csr_matrix(edges.multiply(np.repeat(weights, 3)[:, None]))
    return edges, csr_matrix(edges.T @ weighted)
