"""Catmull-Clark subdivision (Catmull and Clark 1978): a coarse cage becomes a smooth all-quad surface."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array, vstack

from deformation.mesh import Mesh, all_quads


def catmull_clark(mesh: Mesh, levels: int = 1) -> Mesh:
    """The mesh after that many levels: V + E + F vertices and one quad a face corner, each level.

    Edges with one face are a boundary and follow the cubic B-spline of their own (DeRose, Kass and Truong 1998), so
    that an open mesh keeps its rim. The new vertices stand in the order: old vertices, edges, faces.
    """
    for _ in range(levels):
        mesh = all_quads(subdivision_matrix(mesh) @ mesh.vertices, _split_quads(mesh))
    return mesh


def subdivision_matrix(mesh: Mesh) -> csr_array:
    """(V + E + F, V) sparse: new vertices as weighted means of the old; also carries colours or weights along."""
    size = len(mesh.vertices)
    to_face = _face_means(mesh)
    pairs, _, edge_faces = _edge_table(mesh)
    boundary = edge_faces[:, 1] < 0
    midpoints = _rows(pairs, np.full(pairs.shape, 0.5), size)
    beside = _rows(np.maximum(edge_faces, 0), np.full(pairs.shape, 0.25), len(mesh.quads) + len(mesh.triangles))
    to_edge = _scale(np.where(boundary, 1.0, 0.5), midpoints) + _scale(~boundary, beside @ to_face)
    return csr_array(vstack([_vertex_rule(size, pairs, boundary, midpoints, to_face), to_edge, to_face]))


def _vertex_rule(
    size: int, pairs: NDArray[np.int32], boundary: NDArray[np.bool_], midpoints: csr_array, to_face: csr_array
) -> csr_array:
    """(V, V): (F + 2 R + (n - 3) P) / n inside, (R_rim + P) / 2 on a rim, P where no edge ends."""
    edge_of_vertex = _rows(pairs, np.ones(pairs.shape), size).T
    n = np.bincount(pairs.ravel(), minlength=size)
    rim = np.bincount(pairs[boundary].ravel(), minlength=size)
    inside = (n > 0) & (rim == 0)
    valence, rim_valence = np.maximum(n, 1), np.maximum(rim, 1)
    face_of_vertex = csr_array(to_face.T.astype(bool).astype(float))
    faces = np.maximum(np.bincount(face_of_vertex.nonzero()[0], minlength=size), 1)
    face_part = _scale(inside / (faces * valence), face_of_vertex @ to_face)
    edge_part = _scale(inside * 2 / valence**2, edge_of_vertex @ midpoints)
    rim_part = _scale(0.5 / rim_valence, edge_of_vertex @ _scale(boundary, midpoints))
    own = np.select([n == 0, rim > 0], [1.0, 0.5], (valence - 3) / valence)
    return face_part + edge_part + rim_part + diags_array(own)


def _split_quads(mesh: Mesh) -> NDArray[np.int32]:
    """One quad a corner: (corner, edge to the next, face centre, edge from the one before)."""
    pairs, side_edge, _ = _edge_table(mesh)
    first_edge, first_face = len(mesh.vertices), len(mesh.vertices) + len(pairs)
    quads, start, face = [], 0, first_face
    for faces in (mesh.quads, mesh.triangles):
        count, width = faces.shape
        side = side_edge[start : start + count * width].reshape(count, width) + first_edge
        centre = np.repeat(np.arange(face, face + count)[:, None], width, axis=1)
        quads.append(np.stack([faces, side, centre, np.roll(side, 1, axis=1)], axis=-1).reshape(-1, 4))
        start, face = start + count * width, face + count
    return np.concatenate(quads).astype(np.int32)


def _edge_table(mesh: Mesh) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    """Edges (E, 2), each half-edge's edge (H,), each edge's first two faces (E, 2), -1 for none."""
    pairs, side_edge = np.unique(np.sort(mesh.half_edges, axis=1), axis=0, return_inverse=True)
    side_edge = side_edge.ravel()
    quads, triangles = len(mesh.quads), len(mesh.triangles)
    face = np.concatenate([np.repeat(np.arange(quads), 4), np.repeat(np.arange(quads, quads + triangles), 3)])
    order = np.argsort(side_edge, kind="stable")
    first = np.searchsorted(side_edge[order], np.arange(len(pairs)))
    count = np.bincount(side_edge, minlength=len(pairs))
    second = np.where(count > 1, face[order[np.minimum(first + 1, len(order) - 1)]], -1)
    return pairs, side_edge, np.stack([face[order[first]], second], axis=1)


def _face_means(mesh: Mesh) -> csr_array:
    size = len(mesh.vertices)
    parts = [_rows(faces, np.full(faces.shape, 1 / faces.shape[1]), size) for faces in (mesh.quads, mesh.triangles)]
    return csr_array(vstack(parts))


def _rows(columns: NDArray, weights: NDArray[np.float64], width: int) -> csr_array:
    """(N, width) sparse from columns (N, k) and weights (N, k)."""
    row = np.repeat(np.arange(len(columns)), columns.shape[1])
    return csr_array(coo_array((weights.ravel(), (row, columns.ravel())), shape=(len(columns), width)))


def _scale(factors: NDArray, matrix: csr_array) -> csr_array:
    """Each row times its factor."""
    return csr_array(diags_array(factors.astype(float)) @ matrix)
