"""Bones that twist along their length: a forearm turns with its hand, most at the wrist and not at the elbow.

Blending alone wrings the whole turn of a hand into a hand's breadth of wrist. Here the flesh of the bone before takes a
share of its child's twist that grows along it, as with the twist of "stretchable and twistable bones" (Jacobson and
Sorkine 2011), so that at the joint both agree. The turned matrices are worked out at a few places along each bone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.kernel import kernel
from devices.frame import frozen
from reconstruction.skeleton import Skeleton

PLACES = 17
"""Places along a bone, the ends included, for which its matrix is worked out; between them it is linear."""

_TWISTING = ("hand", "head")
"""Bones whose twist goes along the bone before them, forearm and neck. Knees and elbows are hinges, hips and shoulders
turn about another axis than the bone before, and a chest does not turn with its neck."""

_FULL, _NONE = np.radians(150), np.radians(180)
"""Twist up to which all of it is shared, and at which, the way round being a toss-up, none."""


@dataclass(frozen=True, eq=False)
class Twists:
    """The bones that twist, and where points lie along them.

    joints, children: (K,) int32 the joint at the head of each bone and the one at its tail.
    origins: (K, 3) metres and axes: (K, 3) unit, rest pose: the line it twists about.
    bone: (N, 4) int32 the twisting bone, of K, at each of a point's joints, -1 for none; place: (N, 4) 0 to PLACES - 1.
    """

    joints: NDArray[np.int32]
    children: NDArray[np.int32]
    origins: NDArray[np.float64]
    axes: NDArray[np.float64]
    bone: NDArray[np.int32]
    place: NDArray[np.float64]


def find_twists(
    skeleton: Skeleton,
    positions: NDArray[np.float64],
    joints: NDArray[np.int32],
    points: NDArray[np.float64] | None,
) -> Twists:
    """positions: (J, 3) metres of the joints, points: (N, 3) metres bound to joints (N, 4), all in the rest pose.

    Without points no bone twists.
    """
    pairs = []
    for name, child in skeleton.humanoid.items():
        parent = int(skeleton.parents[child])
        twists = name.removeprefix("left_").removeprefix("right_") in _TWISTING and parent >= 0
        if twists and np.linalg.norm(positions[child] - positions[parent]) > 1e-6:
            pairs.append((parent, child))
    if points is None:
        pairs = []
    heads, tails = np.array(pairs, np.int32).reshape(-1, 2).T
    along = positions[tails] - positions[heads]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    axes = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    row = np.full(len(skeleton), -1, np.int32)
    row[heads] = np.arange(len(heads))
    bone = row[joints]
    place = np.zeros(joints.shape)
    if points is not None and len(heads):
        away = points[:, None, :] - positions[heads][bone]
        share = np.einsum("nki,nki->nk", away, axes[bone]) / length[bone][..., 0]
        place = np.where(bone >= 0, np.clip(share, 0, 1), 0) * (PLACES - 1)
    return Twists(
        frozen(np.ascontiguousarray(heads)),
        frozen(np.ascontiguousarray(tails)),
        frozen(positions[heads]),
        frozen(axes),
        frozen(bone),
        frozen(np.ascontiguousarray(place)),
    )


def twisted_reference(motion: NDArray[np.float64], twists: Twists) -> NDArray[np.float64]:
    """(K, PLACES, 3, 4): each twisting bone's motion at places along it, in plain NumPy; motion: (J, 3, 4)."""
    own, child = motion[twists.joints], motion[twists.children]
    turn = np.einsum("kji,kjl->kil", own[:, :, :3], child[:, :, :3])
    odd = np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1
    )
    angle = 2 * np.arctan2(np.einsum("ki,ki->k", odd, twists.axes), 1 + np.einsum("kii->k", turn))
    angle *= np.clip((_NONE - np.abs(angle)) / (_NONE - _FULL), 0, 1)
    part = angle[:, None] * np.linspace(0, 1, PLACES)
    sine, rest = np.sin(part)[..., None, None], (1 - np.cos(part))[..., None, None]
    x, y, z = twists.axes.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 1, 3, 3)
    turned = np.eye(3) + sine * cross + rest * (cross @ cross)
    shift = twists.origins[:, None] - np.einsum("kpij,kj->kpi", turned, twists.origins)
    result = np.empty((len(twists.joints), PLACES, 3, 4))
    result[..., :3] = own[:, None, :, :3] @ turned
    result[..., 3] = np.einsum("kij,kpj->kpi", own[:, :, :3], shift) + own[:, None, :, 3]
    return result


def twisted(motion: NDArray[np.float64], twists: Twists) -> NDArray[np.float64]:
    """`twisted_reference` compiled."""
    out = np.empty((len(twists.joints), PLACES, 3, 4))
    _twisted(motion, twists.joints, twists.children, twists.origins, twists.axes, out)
    return out


@kernel
def _twisted(motion, joints, children, origins, axes, out):
    turn, by = np.empty((3, 3)), np.empty((3, 4))
    for k in range(len(joints)):
        own, child = motion[joints[k]], motion[children[k]]
        for i in range(3):
            for j in range(3):
                turn[i, j] = own[0, i] * child[0, j] + own[1, i] * child[1, j] + own[2, i] * child[2, j]
        x, y, z = axes[k, 0], axes[k, 1], axes[k, 2]
        odd = x * (turn[2, 1] - turn[1, 2]) + y * (turn[0, 2] - turn[2, 0]) + z * (turn[1, 0] - turn[0, 1])
        angle = 2.0 * np.arctan2(odd, 1.0 + turn[0, 0] + turn[1, 1] + turn[2, 2])
        angle *= min(max((_NONE - abs(angle)) / (_NONE - _FULL), 0.0), 1.0)
        for p in range(PLACES):
            part = angle * p / (PLACES - 1)
            s, c = np.sin(part), 1.0 - np.cos(part)
            by[0, 0], by[0, 1], by[0, 2] = 1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y
            by[1, 0], by[1, 1], by[1, 2] = c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x
            by[2, 0], by[2, 1], by[2, 2] = c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)
            for i in range(3):
                by[i, 3] = origins[k, i]
                for j in range(3):
                    by[i, 3] -= by[i, j] * origins[k, j]
            for i in range(3):
                for j in range(4):
                    out[k, p, i, j] = own[i, 0] * by[0, j] + own[i, 1] * by[1, j] + own[i, 2] * by[2, j]
                out[k, p, i, 3] += own[i, 3]
