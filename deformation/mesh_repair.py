"""What is wrong with people's meshes, mended where that is safe, and said in one line each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from deformation.kernel import kernel
from deformation.mesh import Mesh, boundary_edges, components, volume
from devices.errors import SixpointError

_SAME_PLACE_M = 1e-6
_UNITS = ((0.01, "centimetres"), (0.1, "decimetres"), (0.001, "millimetres"), (0.0254, "inches"))
_PERSON_M = (0.4, 3.5)
"""Heights that are left alone; taller meshes are tried in other units until they come to between 1 and 2.5 metres."""


@dataclass(frozen=True, eq=False)
class Repair:
    """A mended mesh. kept: (V',) the old number of each vertex; notes: what was done or is open, one line each."""

    mesh: Mesh
    kept: NDArray[np.int64]
    notes: tuple[str, ...]


def repaired(mesh: Mesh, name: str) -> Repair:
    """The mesh without degenerate or doubled faces and loose vertices, every piece turned outward.

    Holes stay and are told: the lattice closes what is narrower than a cell. Raises SixpointError where
    no face is left.
    """
    notes: list[str] = []
    place = same_places(mesh.vertices)
    faces, sizes = _faces(mesh)
    faces, sizes = _without(_degenerate(place[faces]), faces, sizes, "without area", mesh, notes)
    faces, sizes = _without(_doubled(place[faces]), faces, sizes, "there twice", mesh, notes)
    if not len(faces):
        raise SixpointError(f"{name}: no face has an area; a character needs a surface")
    turned = _flips(place[faces], sizes, mesh.vertices)
    if turned.any():
        notes.append(f"{_count(turned.sum(), 'face')} looked inward near {_where(mesh, faces[turned])}: turned")
    faces[turned] = _reversed(faces[turned], sizes[turned])
    used = np.unique(faces)
    if len(used) < len(mesh.vertices):
        notes.append(f"{_count(len(mesh.vertices) - len(used), 'vertex', 'vertices')} no face uses: dropped")
    result = _rebuilt(mesh.vertices[used], np.searchsorted(used, faces), sizes)
    notes += _open_places(result)
    return Repair(result, used, tuple(f"{name}: {note}" for note in notes))


def in_metres(vertices: NDArray[np.float64], name: str) -> tuple[float, str | None]:
    """What one unit of the vertices (V, 3) is in metres, guessed from a person's height, and a line if not one."""
    height = float(np.ptp(vertices[:, 1]))
    if height <= _PERSON_M[1]:
        small = f"{name}: only {height:.3g} m tall: give its unit if it is meant to be a person"
        return 1.0, None if height >= _PERSON_M[0] else small
    for unit, word in _UNITS:
        if 1.0 <= height * unit <= 2.5:
            return unit, f"{name}: {height:.4g} units tall, read as {word}: {height * unit:.2f} m"
    return 1.0, f"{name}: {height:.4g} m tall: give its unit if it is meant to be a person"


def same_places(vertices: NDArray[np.float64]) -> NDArray[np.int64]:
    """(V,) for each vertex the first one at the same place, so that seams of texture count as joined."""
    close = KDTree(vertices).query_pairs(_SAME_PLACE_M, output_type="ndarray")
    graph = coo_array((np.ones(len(close)), (close[:, 0], close[:, 1])), shape=(len(vertices),) * 2)
    _, group = connected_components(graph, directed=False)
    first = np.full(group.max(initial=-1) + 1, len(vertices))
    np.minimum.at(first, group, np.arange(len(vertices)))
    return first[group]


def _faces(mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(N, 4) corners, a triangle's last one twice, and (N,) how many it has."""
    triangles = mesh.triangles[:, [0, 1, 2, 2]]
    sizes = np.r_[np.full(len(mesh.quads), 4), np.full(len(triangles), 3)]
    return np.concatenate([mesh.quads, triangles]).astype(np.int64), sizes


def _without(
    bad: NDArray[np.bool_],
    faces: NDArray[np.int64],
    sizes: NDArray[np.int64],
    what: str,
    mesh: Mesh,
    notes: list[str],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    if bad.any():
        notes.append(f"{_count(bad.sum(), 'face')} {what} near {_where(mesh, faces[bad])}: dropped")
    return faces[~bad], sizes[~bad]


def _degenerate(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(N,) faces with fewer than three corners in different places."""
    ordered = np.sort(faces, axis=1)
    return (np.diff(ordered, axis=1) != 0).sum(axis=1) < 2


def _doubled(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(N,) faces whose corners an earlier one has, whichever way round."""
    corners = np.sort(faces, axis=1)
    size = faces.max(initial=0) + 1
    halves = corners[:, 0] * size + corners[:, 1], corners[:, 2] * size + corners[:, 3]
    order = np.lexsort(halves)
    same = np.all([np.diff(half[order]) == 0 for half in halves], axis=0)
    bad = np.zeros(len(faces), bool)
    bad[order[1:][same]] = True
    return bad


def _flips(faces: NDArray[np.int64], sizes: NDArray[np.int64], vertices: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(N,) faces to turn so that neighbours agree and every piece encloses a positive volume."""
    pairs, against = _neighbours(faces, sizes)
    turn, piece = _agreeing(pairs, against, len(faces))
    signed = _signed_volumes(faces, vertices, piece) * np.where(turn, -1.0, 1.0)
    inward = np.bincount(piece, signed) < 0
    return turn ^ inward[piece]


@kernel
def _agreeing(pairs, against, count):
    """(N,) faces to turn so that each agrees with the one it was reached from, and (N,) the piece each is in."""
    first = np.zeros(count + 1, np.int64)
    for n in range(len(pairs)):
        for k in range(2):
            first[pairs[n, k] + 1] += 1
    for face in range(count):
        first[face + 1] += first[face]
    fill = first[:-1].copy()
    listed = np.empty(2 * len(pairs), np.int64)
    for n in range(len(pairs)):
        for k in range(2):
            listed[fill[pairs[n, k]]] = n
            fill[pairs[n, k]] += 1
    turn = np.zeros(count, np.bool_)
    piece = np.full(count, -1, np.int64)
    queue = np.empty(count, np.int64)
    pieces = 0
    for seed in range(count):
        if piece[seed] >= 0:
            continue
        piece[seed] = pieces
        queue[0] = seed
        read, end = 0, 1
        while read < end:
            face = queue[read]
            read += 1
            for slot in range(first[face], first[face + 1]):
                n = listed[slot]
                other = pairs[n, 0] if pairs[n, 1] == face else pairs[n, 1]
                if piece[other] < 0:
                    piece[other] = pieces
                    turn[other] = turn[face] ^ against[n]
                    queue[end] = other
                    end += 1
        pieces += 1
    return turn, piece


def _neighbours(faces: NDArray[np.int64], sizes: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """(P, 2) pairs of faces over edges that exactly two have, and (P,) whether these run the edge the same way."""
    after = np.roll(faces, -1, axis=1)
    after[sizes == 3, 2] = faces[sizes == 3, 0]
    side = np.stack([faces, after], axis=-1)[np.arange(4) < sizes[:, None]]
    owner = np.repeat(np.arange(len(faces)), sizes)
    forward = side[:, 0] < side[:, 1]
    name = side.min(axis=1) * (faces.max(initial=0) + 1) + side.max(axis=1)
    order = np.argsort(name, kind="stable")
    starts = np.flatnonzero(np.diff(name[order], prepend=-1))
    two = starts[np.diff(starts, append=len(order)) == 2]
    pairs = order[np.stack([two, two + 1], axis=1)]
    return owner[pairs], forward[pairs[:, 0]] == forward[pairs[:, 1]]


def _signed_volumes(
    faces: NDArray[np.int64], vertices: NDArray[np.float64], piece: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(N,) the tetrahedra under each face from its piece's middle."""
    centre = vertices[faces].mean(axis=1)
    count = np.bincount(piece)
    middle = np.stack([np.bincount(piece, centre[:, i]) / count for i in range(3)], axis=1)[piece]
    a, b, c, d = (vertices[faces[:, i]] - middle for i in range(4))
    return np.einsum("ni,ni->n", a, np.cross(b, c) + np.cross(c, d))


def _reversed(faces: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """The other way round; a triangle's last corner stays doubled."""
    quad = faces[:, [0, 3, 2, 1]]
    return np.where((sizes == 4)[:, None], quad, faces[:, [0, 2, 1, 1]])


def _rebuilt(vertices: NDArray[np.float64], faces: NDArray[np.int64], sizes: NDArray[np.int64]) -> Mesh:
    return Mesh(vertices, faces[sizes == 4].astype(np.int32), faces[sizes == 3, :3].astype(np.int32))


def _open_places(mesh: Mesh) -> list[str]:
    """Lines on what is no fault to mend but good to know: rims and pieces."""
    place = same_places(mesh.vertices)
    welded = Mesh(mesh.vertices, place[mesh.quads].astype(np.int32), place[mesh.triangles].astype(np.int32))
    rim, notes = boundary_edges(welded), []
    if len(rim):
        notes.append(
            f"{_count(len(rim), 'edge')} of holes, the first near {_place(mesh.vertices[rim[0]].mean(axis=0))}"
        )
    pieces = len(np.unique(components(welded)[np.unique(place)]))
    if pieces > 1:
        notes.append(f"{pieces} separate pieces")
    if not len(rim) and volume(welded) < 1e-6:
        notes.append("its surface encloses no volume")
    return notes


def _count(number: int, one: str, many: str | None = None) -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


def _where(mesh: Mesh, faces: NDArray[np.int64]) -> str:
    return _place(mesh.vertices[faces[0]].mean(axis=0))


def _place(point: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{value:.3g}" for value in point) + ")"
