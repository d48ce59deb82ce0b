"""Hierarchical volume preservation: part by part, from the root to the leaves (paper III-D, eq. 6-10).

A particle's volume is that of its octants, one in each cell around it, spanned by half edges and signed:
what turns inside out counts against it. Octants without a cell hold nothing and are left out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.heat_weights import blur
from deformation.kernel import kernel
from deformation.lattice import CORNERS, Lattice
from devices.frame import frozen
from reconstruction.skeleton import Skeleton

_SMALLEST_PART = 12
"""Particles below which a part is counted to its parent's: fewer hold no volume worth keeping."""

_TOLERANCE = 2e-3
"""Relative loss of a part that is left as it is."""

_BLUR = 2
"""Steps along the lattice over which the correction of one part goes over into that of the next."""

_LEAST_SHARE = 0.02

_SWEEPS = 5
"""Walks from the root to the leaves: a part's correction moves octants of its neighbours too."""


@dataclass(frozen=True, eq=False)
class VolumeParts:
    """The joint-dependent parts of a lattice (fig. 5b), parents first, and the field that corrects them.

    part_of: (P,) int32 part of each particle. joints: (K,) int32 the joint that each part lies around.
    octants: (O, 4) int32 a particle and its neighbours along three edges, right-handed, sorted by the particle's part;
        octant_first: (K + 1,) int32 where each part's begin.
    members: (M,) int32 particles that a part's correction moves, sorted by part; shares: (M,) how far each goes along,
        fading out beyond the part's border so that no crease shows; member_first: (K + 1,) int32.
    volumes: (K,) cubic metres at rest, eq. 8. outward: (P, 3) rest pose, s_p u_p of eq. 9.
    """

    part_of: NDArray[np.int32]
    joints: NDArray[np.int32]
    octants: NDArray[np.int32]
    octant_first: NDArray[np.int32]
    members: NDArray[np.int32]
    shares: NDArray[np.float64]
    member_first: NDArray[np.int32]
    volumes: NDArray[np.float64]
    outward: NDArray[np.float64]


def volume_parts(lattice: Lattice, joint_of: NDArray[np.int32]) -> VolumeParts:
    """Divides a lattice into joint-dependent parts; joint_of: (P,) the joint that each particle's part lies around."""
    joints, part_of = np.unique(joint_of, return_inverse=True)
    joints, part_of = joints.astype(np.int32), part_of.reshape(-1).astype(np.int32)
    octants = lattice_octants(lattice)
    octants = octants[np.argsort(part_of[octants[:, 0]], kind="stable")]
    members, shares, member_first = _members(lattice, part_of, len(joints))
    parts = np.arange(len(joints) + 1)
    octant_first = np.searchsorted(part_of[octants[:, 0]], parts).astype(np.int32)
    size = np.bincount(part_of[octants[:, 0]], octant_volumes(lattice.particles, octants), minlength=len(joints))
    return VolumeParts(
        frozen(part_of),
        frozen(joints),
        frozen(np.ascontiguousarray(octants)),
        frozen(octant_first),
        frozen(members),
        frozen(shares),
        frozen(member_first),
        frozen(size),
        frozen(outward_field(lattice)),
    )


def joint_parts(
    lattice: Lattice, bone: NDArray[np.int32], skeleton: Skeleton, positions: NDArray[np.float64]
) -> NDArray[np.int32]:
    """(P,) the joint around which each particle's part lies; bone: (P,) the joint that turns the particle's bone.

    A bone's particles go half to the joint at its head and half to the joints at its tail (fig. 5). positions: (J, 3)
    metres of the joints in the rest pose.
    """
    around = bone.copy()
    for joint in np.unique(bone):
        ends = [int(joint), *(c for c in skeleton.children[joint] if not skeleton.is_end[c])]
        own = np.flatnonzero(bone == joint)
        apart = np.linalg.norm(lattice.particles[own, None] - positions[ends], axis=2)
        around[own] = np.array(ends)[apart.argmin(axis=1)]
    return around


def without_small_parts(joint_of: NDArray[np.int32], skeleton: Skeleton) -> NDArray[np.int32]:
    """(P,) parts in which those too small to hold a volume worth keeping are counted to their parent's."""
    around = joint_of.copy()
    for joint in range(len(skeleton) - 1, 0, -1):
        if 0 < np.count_nonzero(around == joint) < _SMALLEST_PART:
            around[around == joint] = skeleton.parents[joint]
    return around


def _members(
    lattice: Lattice, part_of: NDArray[np.int32], parts: int
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int32]]:
    """The particles that each part's correction moves, their shares, and where each part's begin.

    The shares are the parts themselves, blurred along the lattice; at each particle they sum to 1.
    """
    share, mean = np.eye(parts)[part_of], blur(lattice)
    for _ in range(_BLUR):
        share = np.asarray(mean @ share)
    share[share < _LEAST_SHARE] = 0
    share /= share.sum(axis=1, keepdims=True)
    part, members = np.nonzero(share.T)
    first = np.searchsorted(part, np.arange(parts + 1))
    return members.astype(np.int32), np.ascontiguousarray(share[members, part]), first.astype(np.int32)


def lattice_octants(lattice: Lattice) -> NDArray[np.int32]:
    """(8 C, 4) int32: each corner of each cell with its neighbours along the edges, in right-handed order."""
    rows = []
    for corner, offset in enumerate(CORNERS):
        x, y, z = (corner ^ 1, corner ^ 2, corner ^ 4)
        rows.append([corner, x, y, z] if offset.sum() % 2 == 0 else [corner, y, x, z])
    return lattice.cells[:, rows].reshape(-1, 4)


def octant_volumes(particles: NDArray[np.float64], octants: NDArray[np.int32]) -> NDArray[np.float64]:
    """(O,) signed cubic metres: the box product of three half edges (eq. 6 and 7, one term of the sum)."""
    p, a, b, c = (particles[octants[:, k]] for k in range(4))
    return np.einsum("oi,oi->o", a - p, np.cross(b - p, c - p)) / 8


def part_volumes(particles: NDArray[np.float64], parts: VolumeParts) -> NDArray[np.float64]:
    """(K,) cubic metres of each part (eq. 8)."""
    part = parts.part_of[parts.octants[:, 0]]
    return np.bincount(part, octant_volumes(particles, parts.octants), len(parts.joints)).astype(np.float64)


def outward_field(lattice: Lattice) -> NDArray[np.float64]:
    """(P, 3): unit vectors towards the nearest boundary, over one more than the steps there: s_p u_p of eq. 9."""
    size = len(lattice.particles)
    away = np.zeros((size, 3))
    for corner, offset in enumerate(CORNERS):
        np.add.at(away, lattice.cells[:, corner], 2.0 * offset - 1.0)
    cells = np.bincount(lattice.cells.reshape(-1), minlength=size)
    depth = np.where(cells < len(CORNERS), 0, -1)
    edges = np.concatenate(
        [lattice.cells[:, [a, b]] for a in range(8) for b in range(a + 1, 8) if (a ^ b) in (1, 2, 4)]
    )
    edges = np.concatenate([edges, edges[:, ::-1]])
    step = 0
    while (depth < 0).any():
        inward = edges[(depth[edges[:, 0]] == step) & (depth[edges[:, 1]] < 0)]
        if not len(inward):
            break
        np.add.at(away, inward[:, 1], _unit(away[inward[:, 0]]))
        step += 1
        depth[inward[:, 1]] = step
    return _unit(away) / (1.0 + np.maximum(depth, 0))[:, None]


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 1e-9)


def preserve_reference(
    particles: NDArray[np.float64], rotations: NDArray[np.float64], parts: VolumeParts, reach: float
) -> NDArray[np.float64]:
    """Corrected particles (P, 3) in plain NumPy; arguments as for `preserve`."""
    corrected = particles.copy()
    turned = np.einsum("pij,pj->pi", rotations, parts.outward)
    for _ in range(_SWEEPS):
        for part, target in enumerate(parts.volumes):
            octants = parts.octants[parts.octant_first[part] : parts.octant_first[part + 1]]
            loss = octant_volumes(corrected, octants).sum() - target
            if abs(loss) <= _TOLERANCE * target:
                continue
            own = slice(parts.member_first[part], parts.member_first[part + 1])
            field = np.zeros_like(turned)
            field[parts.members[own]] = parts.shares[own, None] * turned[parts.members[own]]
            corrected += _root(_cubic(corrected, field, octants, loss), reach) * field
    return corrected


def _cubic(
    particles: NDArray[np.float64], field: NDArray[np.float64], octants: NDArray[np.int32], loss: float
) -> tuple[float, float, float, float]:
    """The coefficients, constant first, of Vol(P' + lambda V) - Vol(P) (eq. 10)."""
    e = particles[octants[:, 1:]] - particles[octants[:, :1]]
    f = field[octants[:, 1:]] - field[octants[:, :1]]
    cross_e = [np.cross(e[:, (k + 1) % 3], e[:, (k + 2) % 3]) for k in range(3)]
    cross_f = [np.cross(f[:, (k + 1) % 3], f[:, (k + 2) % 3]) for k in range(3)]
    first = sum((f[:, k] * cross_e[k]).sum() for k in range(3)) / 8
    second = sum((e[:, k] * cross_f[k]).sum() for k in range(3)) / 8
    return float(loss), float(first), float(second), float((f[:, 0] * cross_f[0]).sum() / 8)


@kernel
def _root(cubic, reach):
    """The real root that Newton finds from zero, kept within +-reach; zero where the volume does not grow outward."""
    c0, c1, c2, c3 = cubic
    if c1 <= 0.0:
        return 0.0
    x = 0.0
    for _ in range(8):
        slope = c1 + x * (2.0 * c2 + x * 3.0 * c3)
        if slope <= 0.0:
            break
        step = (c0 + x * (c1 + x * (c2 + x * c3))) / slope
        x = min(max(x - step, -reach), reach)
        if abs(step) < 1e-12:
            break
    return x


def preserve(particles: NDArray[np.float64], rotations: NDArray[np.float64], parts: VolumeParts, reach: float) -> None:
    """Moves particles (P, 3) metres outward or inward, in place, until each part has its volume back.

    rotations: (P, 3, 3) of the skinning, R_p of eq. 9. reach: metres, the farthest that a particle is moved a sweep.
    """
    _preserve(
        particles,
        rotations,
        parts.octants,
        parts.octant_first,
        parts.members,
        parts.shares,
        parts.member_first,
        parts.volumes,
        parts.outward,
        reach,
    )


@kernel
def _preserve(x, rotations, octants, octant_first, members, shares, member_first, volumes, outward, reach):
    field = np.zeros_like(x)
    for _ in range(_SWEEPS):
        settled = True
        for part in range(len(volumes)):
            start, stop = octant_first[part], octant_first[part + 1]
            loss = _volume(x, octants, start, stop) - volumes[part]
            if abs(loss) <= _TOLERANCE * volumes[part]:
                continue
            settled = False
            for m in range(member_first[part], member_first[part + 1]):
                p = members[m]
                for i in range(3):
                    field[p, i] = shares[m] * (
                        rotations[p, i, 0] * outward[p, 0]
                        + rotations[p, i, 1] * outward[p, 1]
                        + rotations[p, i, 2] * outward[p, 2]
                    )
            by = _root(_coefficients(x, field, octants, start, stop, loss), reach)
            for m in range(member_first[part], member_first[part + 1]):
                p = members[m]
                for i in range(3):
                    x[p, i] += by * field[p, i]
                    field[p, i] = 0.0
        if settled:
            break


@kernel
def _volume(x, octants, start, stop):
    total = 0.0
    for o in range(start, stop):
        p, a, b, c = octants[o, 0], octants[o, 1], octants[o, 2], octants[o, 3]
        ax, ay, az = x[a, 0] - x[p, 0], x[a, 1] - x[p, 1], x[a, 2] - x[p, 2]
        bx, by, bz = x[b, 0] - x[p, 0], x[b, 1] - x[p, 1], x[b, 2] - x[p, 2]
        cx, cy, cz = x[c, 0] - x[p, 0], x[c, 1] - x[p, 1], x[c, 2] - x[p, 2]
        total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 8.0


@kernel
def _coefficients(x, v, octants, start, stop, loss):
    first, second, third = 0.0, 0.0, 0.0
    for o in range(start, stop):
        p, a, b, c = octants[o, 0], octants[o, 1], octants[o, 2], octants[o, 3]
        ax, ay, az = x[a, 0] - x[p, 0], x[a, 1] - x[p, 1], x[a, 2] - x[p, 2]
        bx, by, bz = x[b, 0] - x[p, 0], x[b, 1] - x[p, 1], x[b, 2] - x[p, 2]
        cx, cy, cz = x[c, 0] - x[p, 0], x[c, 1] - x[p, 1], x[c, 2] - x[p, 2]
        fx, fy, fz = v[a, 0] - v[p, 0], v[a, 1] - v[p, 1], v[a, 2] - v[p, 2]
        gx, gy, gz = v[b, 0] - v[p, 0], v[b, 1] - v[p, 1], v[b, 2] - v[p, 2]
        hx, hy, hz = v[c, 0] - v[p, 0], v[c, 1] - v[p, 1], v[c, 2] - v[p, 2]
        first += fx * (by * cz - bz * cy) + fy * (bz * cx - bx * cz) + fz * (bx * cy - by * cx)
        first += gx * (cy * az - cz * ay) + gy * (cz * ax - cx * az) + gz * (cx * ay - cy * ax)
        first += hx * (ay * bz - az * by) + hy * (az * bx - ax * bz) + hz * (ax * by - ay * bx)
        ux, uy, uz = gy * hz - gz * hy, gz * hx - gx * hz, gx * hy - gy * hx
        second += ax * ux + ay * uy + az * uz
        second += bx * (hy * fz - hz * fy) + by * (hz * fx - hx * fz) + bz * (hx * fy - hy * fx)
        second += cx * (fy * gz - fz * gy) + cy * (fz * gx - fx * gz) + cz * (fx * gy - fy * gx)
        third += fx * ux + fy * uy + fz * uz
    return loss, first / 8.0, second / 8.0, third / 8.0
