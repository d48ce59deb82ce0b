"""Skinning weights by heat: each bone is held hot in a body of which all other bones are cold (paper III-C, eq. 3-5).

The paper spreads the heat by sweeps until "completion"; a lone hot bone would in the end heat everything. With the own
bone at 1 and all others at 0 the steady state is unique, its weights sum to 1 by themselves, and it is the solution of
one sparse linear system: a harmonic function a joint on the graph of eq. 3.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from deformation.lattice import CORNERS, Lattice
from devices.errors import SixpointError
from reconstruction.skeleton import Skeleton

_LONE_BONE = 0.5
"""A joint without an end site gets a bone of this share of its parent's, straight on."""

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


def skeleton_bones(skeleton: Skeleton, positions: NDArray[np.float64], width: float, strength: float = 1.0) -> Bones:
    """A bone from each joint to each of its children, joints at positions (J, 3) metres; zero lengths are left out."""
    segments = [(int(p), positions[p], positions[j]) for j, p in enumerate(skeleton.parents) if p >= 0]
    for joint, children in enumerate(skeleton.children):
        parent = skeleton.parents[joint]
        if not children and not skeleton.is_end[joint] and parent >= 0:
            along = _LONE_BONE * (positions[joint] - positions[parent])
            segments.append((joint, positions[joint], positions[joint] + along))
    kept = [s for s in segments if np.linalg.norm(s[2] - s[1]) > 1e-6]
    if not kept:
        raise SixpointError(f"the skeleton has no bone of any length: its joints are {', '.join(skeleton.names)}")
    return Bones(
        np.array([head for _, head, _ in kept]),
        np.array([tail for _, _, tail in kept]),
        np.array([joint for joint, _, _ in kept]),
        np.full(len(kept), strength),
        np.full(len(kept), width),
    )


def bone_distances(bones: Bones, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, B) metres from points (N, 3) to each bone's segment."""
    along = bones.tails - bones.heads
    away = points[:, None, :] - bones.heads
    share = np.clip(np.einsum("nbi,bi->nb", away, along) / np.einsum("bi,bi->b", along, along), 0, 1)
    return np.linalg.norm(away - share[..., None] * along, axis=2)


def seeds(lattice: Lattice, bones: Bones) -> NDArray[np.int64]:
    """(P,) the bone each particle belongs to outright, as its nearest and within its width; -1 elsewhere.

    A piece of the lattice that no bone reaches gives its particle nearest to a bone to that bone.
    """
    distance = bone_distances(bones, lattice.particles) - bones.width
    nearest = distance.argmin(axis=1)
    gap = distance.min(axis=1)
    seed = np.where(gap <= 0, nearest, -1)
    piece = lattice_pieces(lattice)
    for lone in np.setdiff1d(piece, piece[seed >= 0]):
        members = np.flatnonzero(piece == lone)
        closest = members[gap[members].argmin()]
        seed[closest] = nearest[closest]
    return seed


def lattice_pieces(lattice: Lattice) -> NDArray[np.int32]:
    """(P,) the number of the connected piece of the lattice each particle is in."""
    size = len(lattice.particles)
    first = np.repeat(lattice.cells[:, 0], 7)
    graph = coo_matrix((np.ones(len(first), np.int8), (first, lattice.cells[:, 1:].reshape(-1))), shape=(size, size))
    return connected_components(graph, directed=False)[1]


def conductance(lattice: Lattice) -> csr_matrix:
    """(P, P) symmetric: wt of eq. 4 between particles that share a cell, 1 / (cost + 1) with the cost in cell edges."""
    a, b = np.triu_indices(8, 1)
    weight = 1 / (1 + np.linalg.norm(CORNERS[a] - CORNERS[b], axis=1))
    rows, columns = lattice.cells[:, a].reshape(-1), lattice.cells[:, b].reshape(-1)
    size = len(lattice.particles)
    ones, cost = np.ones(len(rows)), np.tile(weight, len(lattice.cells))
    times = coo_matrix((ones, (rows, columns)), shape=(size, size)).tocsr()
    total = coo_matrix((cost, (rows, columns)), shape=(size, size)).tocsr()
    total.data /= times.data
    return total + total.T


def heat_weights(lattice: Lattice, bones: Bones, joints: int) -> NDArray[np.float64]:
    """(P, J) steady heat of every particle from every joint's bones; rows sum to 1.

    Solves eq. 5, e_p = sum_k ew_pk e_k, for all joints at once with the seeds held: e_j on own ones, 0 on others'.
    """
    seed = seeds(lattice, bones)
    held = seed >= 0
    heat = np.zeros((len(seed), joints))
    heat[held, bones.joints[seed[held]]] = bones.strength[seed[held]]
    if not held.all():
        wt = conductance(lattice)
        laplacian = (diags(np.asarray(wt.sum(axis=1)).ravel()) - wt).tocsr()[~held]
        factor = splu(laplacian[:, ~held].tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        heat[~held] = factor.solve(-(laplacian[:, held] @ heat[held]))
    heat = np.maximum(heat, 0)
    return heat / heat.sum(axis=1, keepdims=True)


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
        branches = [_subtree(skeleton, left), _subtree(skeleton, right)]
        totals = [result[:, branch].sum(axis=1) for branch in branches]
        shared = np.minimum(*totals)
        for branch, total in zip(branches, totals, strict=True):
            result[:, branch] *= ((total - shared) / np.maximum(total, _EPSILON))[:, None]
        result[:, joint] += 2 * shared
    return result


def _subtree(skeleton: Skeleton, joint: int) -> list[int]:
    members = [joint]
    for child in skeleton.children[joint]:
        members += _subtree(skeleton, child)
    return members


def strongest(weights: NDArray[np.float64], count: int = 4) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The `count` largest of each row of weights (N, J), strongest first: joints and weights, (N, count) each.

    Kept weights are scaled to sum to 1; unused places hold joint 0 and weight 0.
    """
    count = min(count, weights.shape[1])
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :count]
    kept = np.take_along_axis(weights, joints, axis=1)
    kept[kept < 1e-4] = 0
    kept /= kept.sum(axis=1, keepdims=True)
    return np.where(kept > 0, joints, 0).astype(np.int32), kept
