"""Points on bones: the primary deformation (paper III-B, eq. 1 and 2).

Blending matrices linearly (eq. 1) shrinks what twists. The paper replaces the blend by its rotation from a polar
decomposition (eq. 2) without saying about which point to turn. Here that is the joint between a point's bones: both
bones agree where it goes, and a twisted forearm keeps its girth. Turned so, a bent joint bulges on its outside; where
a joint swings more than it twists the blend is therefore linear in part, and the volume is kept afterwards.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.kernel import kernel
from deformation.polar import polar, polar_reference
from deformation.twist import PLACES, Twists, find_twists, twisted, twisted_reference
from devices.frame import frozen
from reconstruction.skeleton import Skeleton

_LEAST_TURN = 0.6
"""Share of the rotational blend at a joint that only swings; one that only twists has all of it."""


@dataclass(frozen=True, eq=False)
class Binding:
    """Points bound to joints, at most four each.

    joints: (N, 4) int32; weights: (N, 4), rows sum to 1. centres: (N, 3) metres, rest pose, what points turn about.
    hinges: (N, 4) int32 the joints between a point's bones; hinge_weights: (N, 4), rows sum to 1.
    axes: (J, 3) unit, rest pose, along each joint's bone: a turn about it is a twist. parents: (J,).
    twists: the bones that twist along their length.
    """

    joints: NDArray[np.int32]
    weights: NDArray[np.float64]
    centres: NDArray[np.float64]
    hinges: NDArray[np.int32]
    hinge_weights: NDArray[np.float64]
    axes: NDArray[np.float64]
    parents: NDArray[np.int32]
    twists: Twists


def bind_points(
    skeleton: Skeleton,
    positions: NDArray[np.float64],
    joints: NDArray[np.int32],
    weights: NDArray[np.float64],
    points: NDArray[np.float64] | None = None,
) -> Binding:
    """Finds the joints between each point's bones, by the products of the bones' weights, and their mean as its centre.

    positions: (J, 3) metres of the joints in the rest pose; joints, weights: (N, 4). points: (N, 3) metres, rest pose;
    without them no bone twists along its length.
    """
    between = _joints_between(skeleton)
    share = np.zeros((len(joints), len(skeleton)))
    for a in range(joints.shape[1]):
        for b in range(a + 1, joints.shape[1]):
            share += (weights[:, a] * weights[:, b])[:, None] * between[joints[:, a], joints[:, b]]
    alone = share.sum(axis=1) < 1e-9
    share[alone, joints[alone, 0]] = 1
    share /= share.sum(axis=1, keepdims=True)
    hinges = np.argsort(-share, axis=1, kind="stable")[:, :4].astype(np.int32)
    hinge_weights = np.take_along_axis(share, hinges, axis=1)
    hinge_weights /= hinge_weights.sum(axis=1, keepdims=True)
    return Binding(
        joints,
        weights,
        frozen(share @ positions),
        frozen(hinges),
        frozen(hinge_weights),
        frozen(_bone_axes(skeleton, positions)),
        frozen(np.array(skeleton.parents, np.int32)),
        find_twists(skeleton, positions, joints, points),
    )


def _bone_axes(skeleton: Skeleton, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(J, 3) unit: from each joint to the middle of its children, or on from its parent where it has none."""
    along = np.zeros_like(positions)
    for joint, children in enumerate(skeleton.children):
        if children:
            along[joint] = positions[list(children)].mean(axis=0) - positions[joint]
        if not along[joint].any() and skeleton.parents[joint] >= 0:
            along[joint] = positions[joint] - positions[skeleton.parents[joint]]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return np.divide(along, length, out=np.zeros_like(along), where=length > 1e-9)


def _joints_between(skeleton: Skeleton) -> NDArray[np.float64]:
    """(J, J, J): for two bones, the share of each joint among those on the way from one to the other."""
    above: list[set[int]] = []
    for joint, parent in enumerate(skeleton.parents):
        above.append({joint} | (above[parent] if parent >= 0 else set()))
    share = np.zeros((len(skeleton),) * 3)
    for a in range(len(skeleton)):
        for b in range(len(skeleton)):
            between = sorted(above[a] ^ above[b])
            share[a, b, between] = 1 / max(len(between), 1)
    return share


def joint_motion(T_world_joint: NDArray[np.float64], bind_inverse: NDArray[np.float64]) -> NDArray[np.float64]:
    """(J, 3, 4): what each joint does to points that stand in the rest pose, T_j of eq. 1."""
    return np.ascontiguousarray((T_world_joint @ bind_inverse)[:, :3])


def linear_blend(motion: NDArray[np.float64], binding: Binding, rest: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (N, 3) metres by plain linear blend skinning (eq. 1), the measure of what the rest here is worth.

    motion: (J, 3, 4) of `joint_motion`; rest: (N, 3) metres.
    """
    blended = np.einsum("nk,nkij->nij", binding.weights, motion[binding.joints])
    return np.einsum("nij,nj->ni", blended[:, :, :3], rest) + blended[:, :, 3]


def twist_shares(motion: NDArray[np.float64], binding: Binding) -> NDArray[np.float64]:
    """(J,) how much of each joint's turn against its parent is about its own bone: 0 a pure swing, 1 a pure twist."""
    parent = motion[np.maximum(binding.parents, 0), :, :3]
    turn = np.einsum("jki,jkl->jil", parent, motion[:, :, :3])
    axis = np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1
    )
    size = np.einsum("ji,ji->j", axis, axis)
    about = np.einsum("ji,ji->j", axis, binding.axes) ** 2
    return np.divide(about, size, out=np.zeros_like(size), where=size > 1e-12)


def blend_reference(
    motion: NDArray[np.float64], binding: Binding, rest: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Skinned points (N, 3) metres and rotations (N, 3, 3) in plain NumPy; arguments as for `linear_blend`."""
    blended = np.einsum("nk,nkij->nij", binding.weights, _along_bones(motion, binding))
    rotation = polar_reference(blended[:, :, :3], motion[binding.joints[:, 0], :, :3])
    twist = (twist_shares(motion, binding)[binding.hinges] * binding.hinge_weights).sum(axis=1)
    rigid = (_LEAST_TURN + (1 - _LEAST_TURN) * twist)[:, None, None]
    turn = rigid * rotation + (1 - rigid) * blended[:, :, :3]
    centre = np.einsum("nij,nj->ni", blended[:, :, :3], binding.centres) + blended[:, :, 3]
    return centre + np.einsum("nij,nj->ni", turn, rest - binding.centres), rotation


def _along_bones(motion: NDArray[np.float64], binding: Binding) -> NDArray[np.float64]:
    """(N, 4, 3, 4): what each of a point's joints does to it, twisted as far as it lies along the bone."""
    own, twists = motion[binding.joints], binding.twists
    if not len(twists.joints):
        return own
    levels = twisted_reference(motion, twists)
    low = np.minimum(twists.place.astype(int), PLACES - 2)
    share = (twists.place - low)[..., None, None]
    first, second = levels[twists.bone, low], levels[twists.bone, low + 1]
    return np.where((twists.bone >= 0)[..., None, None], first + share * (second - first), own)


def blend(
    motion: NDArray[np.float64],
    binding: Binding,
    rest: NDArray[np.float64],
    positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
) -> None:
    """`blend_reference` compiled: writes into positions (N, 3) and rotations (N, 3, 3)."""
    twist = np.empty(len(motion))
    _twist_shares(motion, binding.parents, binding.axes, twist)
    _blend(
        motion,
        twist,
        twisted(motion, binding.twists),
        binding.twists.bone,
        binding.twists.place,
        binding.joints,
        binding.weights,
        binding.centres,
        binding.hinges,
        binding.hinge_weights,
        rest,
        positions,
        rotations,
    )


@kernel
def _twist_shares(motion, parents, axes, shares):
    turn = np.empty((3, 3))
    for joint in range(len(motion)):
        above, own = motion[max(parents[joint], 0)], motion[joint]
        for i in range(3):
            for j in range(3):
                turn[i, j] = above[0, i] * own[0, j] + above[1, i] * own[1, j] + above[2, i] * own[2, j]
        x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
        about = x * axes[joint, 0] + y * axes[joint, 1] + z * axes[joint, 2]
        size = x * x + y * y + z * z
        shares[joint] = about * about / size if size > 1e-12 else 0.0


@kernel
def _blend(
    motion, twist, levels, bone, place, joints, weights, centres, hinges, hinge_weights, rest, positions, rotations
):
    m = np.empty((3, 4))
    for n in range(len(rest)):
        m[:] = 0.0
        for k in range(joints.shape[1]):
            weight = weights[n, k]
            if weight > 0 and bone[n, k] < 0:
                for i in range(3):
                    for j in range(4):
                        m[i, j] += weight * motion[joints[n, k], i, j]
            elif weight > 0:
                low = min(int(place[n, k]), PLACES - 2)
                share = place[n, k] - low
                first, second = levels[bone[n, k], low], levels[bone[n, k], low + 1]
                for i in range(3):
                    for j in range(4):
                        m[i, j] += weight * (first[i, j] + share * (second[i, j] - first[i, j]))
        turn = (m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])
        if weights[n, 0] < 1 or bone[n, 0] >= 0:
            found, turn = polar(turn)
            if not found:
                f = motion[joints[n, 0]]
                turn = (f[0, 0], f[0, 1], f[0, 2], f[1, 0], f[1, 1], f[1, 2], f[2, 0], f[2, 1], f[2, 2])
        cx, cy, cz = centres[n, 0], centres[n, 1], centres[n, 2]
        x, y, z = rest[n, 0] - cx, rest[n, 1] - cy, rest[n, 2] - cz
        a00, a01, a02, a10, a11, a12, a20, a21, a22 = turn
        rigid = 0.0
        for k in range(hinges.shape[1]):
            rigid += hinge_weights[n, k] * twist[hinges[n, k]]
        rigid = _LEAST_TURN + (1.0 - _LEAST_TURN) * rigid
        for i in range(3):
            linear = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z
            centre = m[i, 0] * cx + m[i, 1] * cy + m[i, 2] * cz + m[i, 3]
            positions[n, i] = centre + (1.0 - rigid) * linear
        positions[n, 0] += rigid * (a00 * x + a01 * y + a02 * z)
        positions[n, 1] += rigid * (a10 * x + a11 * y + a12 * z)
        positions[n, 2] += rigid * (a20 * x + a21 * y + a22 * z)
        rotations[n, 0, 0], rotations[n, 0, 1], rotations[n, 0, 2] = a00, a01, a02
        rotations[n, 1, 0], rotations[n, 1, 1], rotations[n, 1, 2] = a10, a11, a12
        rotations[n, 2, 0], rotations[n, 2, 1], rotations[n, 2, 2] = a20, a21, a22
