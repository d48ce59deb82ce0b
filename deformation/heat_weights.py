"""Skinning weights by heat: each bone is held hot in a body of which all other bones are cold (paper III-C, eq. 3-5).

The paper spreads the heat by sweeps until "completion"; a lone hot bone would in the end heat everything. With the own
bone at 1 and all others at 0 the steady state is unique, its weights sum to 1 by themselves, and it is the solution of
one sparse linear system: a function a joint on the graph of eq. 3. As in the paper's model, the bone heat of Baran and
Popovic, "Automatic rigging and animation of 3D characters" (2007), every particle also trades heat with its nearest
bone, by the inverse square of their distance: without it the long bones of the hips and shoulders flood the trunk.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from deformation.lattice import CORNERS, Lattice
from devices.errors import SixpointError
from reconstruction.skeleton import Skeleton

_LONE_BONE = 0.5
"""A joint without an end site gets a bone of this share of its parent's, straight on."""

_SIDE_BRANCH = 0.5
"""How far a bone reaches towards a branch that leaves it sideways, hips to thigh: beyond, the flesh is the branch's."""

_TRADE = 6.0
"""Heat that a particle one cell from its nearest bone trades with it, against unit conductance along the lattice."""

_RELATED = 4
"""Steps in the skeleton between bones that may claim each other's flesh through the air."""

_CANDIDATES = 6
"""How many of the nearest bones are looked at for one in sight."""

_SIGHT = np.linspace(0.1, 0.7, 5)
"""Where the way from a bone to a particle is looked at; the particle itself may stand a cell outside."""

_OUTSIDE = 2.0
"""A bone whose middle is so many cells from all of the body drives nothing: a root that stands on the floor, say."""

_LEAST_WEIGHT = 0.01
"""Weights below are dropped: what a hundredth moves is not seen, and lone bones need no polar decomposition."""

_EPSILON = 1e-9


@dataclass(frozen=True, eq=False)
class Bones:
    """The segments that hold heat.

    heads, tails: (B, 3) metres, rest pose. joints: (B,) int the joint that turns each; one joint may turn several.
    strength: (B,) heat e_j at the bone; a stronger bone claims more of what lies between two.
    width: (B,) metres, radius within which particles count as the bone itself.
    """

    heads: NDArray[np.float64]
    tails: NDArray[np.float64]
    joints: NDArray[np.int64]
    strength: NDArray[np.float64]
    width: NDArray[np.float64]


def skeleton_bones(
    skeleton: Skeleton,
    positions: NDArray[np.float64],
    width: NDArray[np.float64] | float,
    strength: NDArray[np.float64] | float = 1.0,
) -> Bones:
    """A bone from each joint to each of its children, joints at positions (J, 3) metres; zero lengths are left out.

    Of several children the one straight on gets a whole bone, the others the first half of one.
    width, strength: of all bones, or (J,) of each joint's.
    """
    segments = []
    for joint, children in enumerate(skeleton.children):
        onward = _child_straight_on(skeleton, positions, joint)
        for child in children:
            reach = 1.0 if child == onward else _SIDE_BRANCH
            segments.append((joint, positions[joint], positions[joint] + reach * (positions[child] - positions[joint])))
        parent = skeleton.parents[joint]
        if not children and not skeleton.is_end[joint] and parent >= 0:
            along = _LONE_BONE * (positions[joint] - positions[parent])
            segments.append((joint, positions[joint], positions[joint] + along))
    kept = [s for s in segments if np.linalg.norm(s[2] - s[1]) > 1e-6]
    if not kept:
        raise SixpointError(f"the skeleton has no bone of any length: its joints are {', '.join(skeleton.names)}")
    joints = np.array([joint for joint, _, _ in kept])
    return Bones(
        np.array([head for _, head, _ in kept]),
        np.array([tail for _, _, tail in kept]),
        joints,
        np.broadcast_to(strength, len(skeleton))[joints],
        np.broadcast_to(width, len(skeleton))[joints],
    )


def _child_straight_on(skeleton: Skeleton, positions: NDArray[np.float64], joint: int) -> int:
    """The child that goes on as the way to the joint went; from the root, the one with most joints below it."""
    children, parent = skeleton.children[joint], skeleton.parents[joint]
    if len(children) < 2:
        return children[0] if children else -1
    if parent < 0:
        return max(children, key=lambda child: len(subtree(skeleton, child)))
    inward = positions[joint] - positions[parent]
    outward = positions[list(children)] - positions[joint]
    length = np.maximum(np.linalg.norm(outward, axis=1), _EPSILON)
    return children[int(np.argmax(outward @ inward / length))]


def bones_inside(bones: Bones, lattice: Lattice) -> Bones:
    """The bones that run in the body. Raises SixpointError where there are none."""
    middle = (bones.heads + bones.tails) / 2
    inside = KDTree(lattice.particles).query(middle)[0] <= _OUTSIDE * lattice.cell_size
    if not inside.any():
        low, high = lattice.particles.min(axis=0).round(2), lattice.particles.max(axis=0).round(2)
        raise SixpointError(
            f"the skeleton stands outside the mesh: joints around {middle.mean(axis=0).round(2)} m, mesh from {low} to "
            f"{high} m; check their units and places"
        )
    return Bones(
        bones.heads[inside], bones.tails[inside], bones.joints[inside], bones.strength[inside], bones.width[inside]
    )


def bone_distances(bones: Bones, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, B) metres from points (N, 3) to each bone's segment."""
    along = bones.tails - bones.heads
    away = points[:, None, :] - bones.heads
    share = np.clip(np.einsum("nbi,bi->nb", away, along) / np.einsum("bi,bi->b", along, along), 0, 1)
    return np.linalg.norm(away - share[..., None] * along, axis=2)


def nearest_bones(lattice: Lattice, bones: Bones, skeleton: Skeleton) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(P,) the bone nearest to each particle and (P,) metres to it less its width, never below zero.

    Nearest is meant within the body: of the bones in sight, none of which is hidden behind air (an arm seen from the
    flank). Where limbs touch (a hand on a thigh) and the bone in sight is no near relative in the skeleton of the one
    nearest along the lattice, the latter counts.
    """
    gap = bone_distances(bones, lattice.particles) - bones.width
    nearest = _nearest_in_sight(lattice, bones, gap)
    straight = np.maximum(gap[np.arange(len(gap)), nearest], 0)
    sources = np.flatnonzero(straight <= 0)
    if not len(sources):
        return nearest, straight
    steps = conductance(lattice)
    steps.data = (1 / steps.data - 1) * lattice.cell_size
    around, _, source = dijkstra(steps, indices=sources, min_only=True, return_predecessors=True)
    within = np.where(np.isfinite(around), nearest[np.maximum(source, 0)], nearest)
    apart = joints_apart(skeleton)[bones.joints[nearest], bones.joints[within]] > _RELATED
    return np.where(apart, within, nearest), np.where(apart, around, straight)


def _nearest_in_sight(lattice: Lattice, bones: Bones, gap: NDArray[np.float64]) -> NDArray[np.int64]:
    """(P,) the nearest bone to which the straight way leads through the body; the nearest one where there is none."""
    candidates = np.argsort(gap, axis=1)[:, :_CANDIDATES]
    head, along = bones.heads[candidates], (bones.tails - bones.heads)[candidates]
    away = lattice.particles[:, None, :] - head
    share = np.clip(np.einsum("pci,pci->pc", away, along) / np.einsum("pci,pci->pc", along, along), 0, 1)
    goal = head + share[..., None] * along
    on_the_way = goal[:, :, None, :] + _SIGHT[:, None] * (lattice.particles[:, None, None, :] - goal[:, :, None, :])
    seen = lattice.voxels.holds(on_the_way).all(axis=2)
    return np.take_along_axis(candidates, seen.argmax(axis=1)[:, None], axis=1)[:, 0]


def joints_apart(skeleton: Skeleton) -> NDArray[np.int64]:
    """(J, J) steps in the skeleton's tree from one joint to another."""
    chains: list[set[int]] = []
    for joint, parent in enumerate(skeleton.parents):
        chains.append({joint} | (chains[parent] if parent >= 0 else set()))
    return np.array([[len(a ^ b) for b in chains] for a in chains])


def conductance(lattice: Lattice) -> csr_matrix:
    """(P, P) symmetric: wt of eq. 4 between particles that share a cell, 1 / (cost + 1) with the cost in cell edges."""
    a, b = np.triu_indices(8, 1)
    weight = 1 / (1 + np.linalg.norm(CORNERS[a] - CORNERS[b], axis=1))
    rows, columns = lattice.cells[:, a].reshape(-1), lattice.cells[:, b].reshape(-1)
    size = len(lattice.particles)
    ones, cost = np.ones(len(rows)), np.tile(weight, len(lattice.cells))
    times = csr_matrix((ones, (rows, columns)), shape=(size, size))
    total = csr_matrix((cost, (rows, columns)), shape=(size, size))
    mean = np.asarray(total.data, np.float64) / np.asarray(times.data, np.float64)
    half = csr_matrix((mean, total.indices, total.indptr), shape=(size, size))
    return csr_matrix(half + half.T)


def heat_weights(lattice: Lattice, bones: Bones, skeleton: Skeleton) -> NDArray[np.float64]:
    """(P, J) steady heat of every particle from every joint's bones; rows sum to 1.

    Solves eq. 5, e_p = sum_k ew_pk e_k, for all joints at once, with the particles within a bone's width held at its
    heat e_j and the others trading heat with their nearest bone.
    """
    bones = bones_inside(bones, lattice)
    nearest, distance = nearest_bones(lattice, bones, skeleton)
    held = distance <= 0
    bone_heat = np.zeros((len(nearest), len(skeleton)))
    bone_heat[np.arange(len(nearest)), bones.joints[nearest]] = bones.strength[nearest]
    heat = np.where(held[:, None], bone_heat, 0)
    if not held.all():
        wt = conductance(lattice)
        trade = _TRADE * (lattice.cell_size / (distance[~held] + bones.width[nearest[~held]])) ** 2
        laplacian = (diags(np.asarray(wt.sum(axis=1)).ravel()) - wt).tocsr()[~held]
        system = (laplacian[:, ~held] + diags(trade)).tocsc()
        factor = splu(system, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        heat[~held] = factor.solve(trade[:, None] * bone_heat[~held] - laplacian[:, held] @ heat[held])
    heat = np.maximum(heat, 0)
    return heat / heat.sum(axis=1, keepdims=True)


def spread(lattice: Lattice, on_vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P, N) values of particles whose interpolation comes near those painted on the vertices (V, N).

    A particle by the surface takes the mean of the vertices in its cells; between those the values are harmonic.
    """
    size, carry = len(lattice.particles), csr_matrix(vertex_carrier(lattice).T)
    total = np.asarray(carry.sum(axis=1)).ravel()
    known = total > _EPSILON
    values = np.zeros((size, on_vertices.shape[1]))
    values[known] = (carry @ on_vertices)[known] / total[known, None]
    if not known.all():
        wt = conductance(lattice)
        laplacian = (diags(np.asarray(wt.sum(axis=1)).ravel()) - wt).tocsr()[~known]
        factor = splu(laplacian[:, ~known].tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        values[~known] = factor.solve(-(laplacian[:, known] @ values[known]))
    return values


def vertex_carrier(lattice: Lattice) -> csr_matrix:
    """(V, P): the trilinear weights by which particles carry vertices; rows sum to 1."""
    share, corners = lattice.vertex_weights, lattice.cells[lattice.vertex_cells]
    first = np.arange(0, share.size + 1, 8)
    return csr_matrix((share.ravel(), corners.ravel(), first), shape=(len(share), len(lattice.particles)))


def blur(lattice: Lattice) -> csr_matrix:
    """(P, P): the mean over a particle's cells of the mean over each cell's corners; rows sum to 1."""
    size, rows = len(lattice.particles), np.repeat(np.arange(len(lattice.cells)), 8)
    corners = lattice.cells.reshape(-1)
    mean = csr_matrix((np.full(len(rows), 1 / 8), (rows, corners)), shape=(len(lattice.cells), size))
    share = 1 / np.bincount(corners, minlength=size)
    return csr_matrix(csr_matrix((share[corners], (corners, rows)), shape=(size, len(lattice.cells))) @ mean)


def opposite_branches(skeleton: Skeleton, positions: NDArray[np.float64]) -> list[tuple[int, int, int]]:
    """(joint, left child, right child) where a joint of the body's middle sends out two limbs to either side.

    positions: (J, 3) metres; left is +X. A limb is on a side where all its joints are, but for those at the middle.
    """
    across = positions[:, 0] - positions[0, 0]
    near = 0.02 * np.ptp(positions[:, 1])
    low, high = across.copy(), across.copy()
    for joint in range(len(skeleton) - 1, 0, -1):
        parent = skeleton.parents[joint]
        low[parent], high[parent] = min(low[parent], low[joint]), max(high[parent], high[joint])
    found = []
    for joint, children in enumerate(skeleton.children):
        left = [c for c in children if low[c] >= -near and high[c] > near]
        right = [c for c in children if high[c] <= near and low[c] < -near]
        found += [(joint, a, b) for a in left for b in right if abs(across[joint]) <= near]
    return found


def separate_branches(
    weights: NDArray[np.float64], skeleton: Skeleton, positions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weights (N, J) in which no point follows a limb and the opposite one, the left and the right leg say, at once.

    What both claim goes to the joint they branch from, so that the weights stay continuous: a limb's share falls to
    nothing where the opposite one's begins. Rows sum to what they summed to.
    """
    result = weights.copy()
    for joint, left, right in opposite_branches(skeleton, positions):
        branches = [subtree(skeleton, left), subtree(skeleton, right)]
        totals = [result[:, branch].sum(axis=1) for branch in branches]
        shared = np.minimum(*totals)
        for branch, total in zip(branches, totals, strict=True):
            result[:, branch] *= ((total - shared) / np.maximum(total, _EPSILON))[:, None]
        result[:, joint] += 2 * shared
    return result


def subtree(skeleton: Skeleton, joint: int) -> list[int]:
    """A joint and all that hang on it."""
    members = [joint]
    for child in skeleton.children[joint]:
        members += subtree(skeleton, child)
    return members


def strongest(weights: NDArray[np.float64], count: int = 4) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The `count` largest of each row of weights (N, J), strongest first: joints and weights, (N, count) each.

    Kept weights are scaled to sum to 1; unused places hold joint 0 and weight 0.
    """
    count = min(count, weights.shape[1])
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :count]
    kept = np.take_along_axis(weights, joints, axis=1)
    kept[kept < _LEAST_WEIGHT] = 0
    kept /= kept.sum(axis=1, keepdims=True)
    return np.where(kept > 0, joints, 0).astype(np.int32), kept
