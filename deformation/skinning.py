"""Particles on bones, and the mesh on particles: the primary deformation (paper III-B, eq. 1 and 2).

Blending matrices linearly shrinks what twists or bends (eq. 1). The paper replaces the blend by its rotation from a
polar decomposition (eq. 2) without saying about which point to turn. Here that is the joint between a particle's
bones: both bones agree where it goes, and a twisted forearm keeps its girth.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.kernel import kernel
from deformation.polar import polar, polar_reference
from devices.frame import frozen
from reconstruction.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Binding:
    """Points bound to joints, at most four each.

    joints: (N, 4) int32; weights: (N, 4), rows sum to 1; centres: (N, 3) metres, rest pose, what points turn about.
    """

    joints: NDArray[np.int32]
    weights: NDArray[np.float64]
    centres: NDArray[np.float64]


def bind_centres(
    skeleton: Skeleton, positions: NDArray[np.float64], joints: NDArray[np.int32], weights: NDArray[np.float64]
) -> Binding:
    """Finds the centre that each point turns about: the joints between its bones, by the products of their weights.

    positions: (J, 3) metres of the joints in the rest pose; joints, weights: (N, 4).
    """
    between = _joints_between(skeleton, positions)
    total = np.full(len(joints), 1e-12)
    centre = positions[joints[:, 0]] * 1e-12
    for a in range(joints.shape[1]):
        for b in range(a + 1, joints.shape[1]):
            share = weights[:, a] * weights[:, b]
            centre += share[:, None] * between[joints[:, a], joints[:, b]]
            total += share
    return Binding(joints, weights, frozen(centre / total[:, None]))


def _joints_between(skeleton: Skeleton, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(J, J, 3) metres: the middle of the joints on the way from one bone to another."""
    chains = []
    for joint in range(len(skeleton)):
        chain = [joint]
        while skeleton.parents[chain[-1]] >= 0:
            chain.append(int(skeleton.parents[chain[-1]]))
        chains.append(chain)
    middle = np.zeros((len(skeleton), len(skeleton), 3))
    for a, chain_a in enumerate(chains):
        for b, chain_b in enumerate(chains):
            apart = set(chain_a) ^ set(chain_b)
            middle[a, b] = positions[sorted(apart)].mean(axis=0) if apart else positions[a]
    return middle


def joint_motion(T_world_joint: NDArray[np.float64], bind_inverse: NDArray[np.float64]) -> NDArray[np.float64]:
    """(J, 3, 4): what each joint does to points that stand in the rest pose, T_j of eq. 1."""
    return np.ascontiguousarray((T_world_joint @ bind_inverse)[:, :3])


def linear_blend(motion: NDArray[np.float64], binding: Binding, rest: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (N, 3) metres by plain linear blend skinning (eq. 1), the measure of what the rest here is worth.

    motion: (J, 3, 4) of `joint_motion`; rest: (N, 3) metres.
    """
    blended = np.einsum("nk,nkij->nij", binding.weights, motion[binding.joints])
    return np.einsum("nij,nj->ni", blended[:, :, :3], rest) + blended[:, :, 3]


def blend_reference(
    motion: NDArray[np.float64], binding: Binding, rest: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Skinned points (N, 3) metres and rotations (N, 3, 3) in plain NumPy; arguments as for `linear_blend`."""
    blended = np.einsum("nk,nkij->nij", binding.weights, motion[binding.joints])
    rotation = polar_reference(blended[:, :, :3], motion[binding.joints[:, 0], :, :3])
    centre = np.einsum("nij,nj->ni", blended[:, :, :3], binding.centres) + blended[:, :, 3]
    return centre + np.einsum("nij,nj->ni", rotation, rest - binding.centres), rotation


def blend(
    motion: NDArray[np.float64],
    binding: Binding,
    rest: NDArray[np.float64],
    positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
) -> None:
    """`blend_reference` compiled: writes into positions (N, 3) and rotations (N, 3, 3)."""
    _blend(motion, binding.joints, binding.weights, binding.centres, rest, positions, rotations)


@kernel
def _blend(motion, joints, weights, centres, rest, positions, rotations):
    m = np.empty((3, 4))
    for n in range(len(rest)):
        m[:] = 0.0
        for k in range(joints.shape[1]):
            weight = weights[n, k]
            if weight > 0:
                for i in range(3):
                    for j in range(4):
                        m[i, j] += weight * motion[joints[n, k], i, j]
        turn = (m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])
        if weights[n, 0] < 1:
            found, turn = polar(turn)
            if not found:
                f = motion[joints[n, 0]]
                turn = (f[0, 0], f[0, 1], f[0, 2], f[1, 0], f[1, 1], f[1, 2], f[2, 0], f[2, 1], f[2, 2])
        cx, cy, cz = centres[n, 0], centres[n, 1], centres[n, 2]
        x, y, z = rest[n, 0] - cx, rest[n, 1] - cy, rest[n, 2] - cz
        a00, a01, a02, a10, a11, a12, a20, a21, a22 = turn
        for i in range(3):
            positions[n, i] = m[i, 0] * cx + m[i, 1] * cy + m[i, 2] * cz + m[i, 3]
        positions[n, 0] += a00 * x + a01 * y + a02 * z
        positions[n, 1] += a10 * x + a11 * y + a12 * z
        positions[n, 2] += a20 * x + a21 * y + a22 * z
        rotations[n, 0, 0], rotations[n, 0, 1], rotations[n, 0, 2] = a00, a01, a02
        rotations[n, 1, 0], rotations[n, 1, 1], rotations[n, 1, 2] = a10, a11, a12
        rotations[n, 2, 0], rotations[n, 2, 1], rotations[n, 2, 2] = a20, a21, a22
