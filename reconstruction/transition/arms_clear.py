"""Arms kept out of the trunk and the thighs: no self-penetration on the way from one pose to another.

Bones are capsules of about the mannequin's girth. Where a forearm would go deeper into the body than the two clips'
own poses have it, the upper arm swings outwards for that while.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from reconstruction.rotations import cross, exponential, inverse, multiply, rotate
from reconstruction.skeleton import Skeleton
from reconstruction.transition.world_joints_kernel import joint_positions_kernel

TRUNK_RADIUS, THIGH_RADIUS, FOREARM_RADIUS = 0.075, 0.045, 0.022
"""Shares of 1.85 times the leg, about from the ankles to the neck: 0.115, 0.07 and 0.035 m for a leg of 0.84 m."""
_TOLERANCE_M = 0.005
_AROUND_S = 0.2
_ROUNDS = 3


def body_capsules(skeleton: Skeleton) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """(A, 3) upper arm, forearm and hand joints of each arm, (K, 2) ends of the body's capsules, and (K + 1,) radii.

    The last radius is the forearms'. No arms where the skeleton lacks a bone that this needs.
    """
    bones = skeleton.humanoid
    arms = [[f"{side}_{bone}" for bone in ("upper_arm", "lower_arm", "hand")] for side in ("left", "right")]
    thighs = [[f"{side}_upper_leg", f"{side}_lower_leg"] for side in ("left", "right")]
    needed = [name for names in (*arms, *thighs, ["hips", "neck"]) for name in names]
    if any(name not in bones for name in needed):
        return np.zeros((0, 3), np.int64), np.zeros((0, 2), np.int64), np.zeros(1)
    segments = [["hips", "neck"], *thighs]
    legs = np.linalg.norm(skeleton.offsets[[bones["left_lower_leg"], bones["left_foot"]]], axis=-1).sum()
    size = 1.85 * float(legs)
    radii = size * np.array([TRUNK_RADIUS, THIGH_RADIUS, THIGH_RADIUS, FOREARM_RADIUS])
    return (
        np.array([[bones[n] for n in arm] for arm in arms]),
        np.array([[bones[n] for n in s] for s in segments]),
        radii,
    )


def cleared_arms(
    skeleton: Skeleton,
    root_positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
    capsules: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]],
    fps: float,
) -> NDArray[np.float64]:
    """Rotations (N, J, 4) whose forearms go no deeper into the body than the first and the last frame have them.

    Those two are the clips' own and stay as they are; between them the depth allowed goes evenly from one to the other.
    """
    arms, segments, radii = capsules
    frames = np.arange(len(rotations))
    for _ in range(_ROUNDS if len(arms) else 0):
        joints, world = joint_positions_kernel(skeleton.parents, skeleton.offsets, root_positions, rotations)
        depths, outwards, contacts = arm_depths_kernel(joints, arms, segments, radii)
        own = np.maximum(depths[:1] + (depths[-1:] - depths[:1]) * (frames / max(frames[-1], 1))[:, None], 0.0)
        excess = depths - own - _TOLERANCE_M
        if excess.max() <= 0:
            break
        rotations = rotations.copy()
        for k, arm in enumerate(arms):
            deepest = int(np.argmax(excess[:, k]))
            if excess[deepest, k] > 0:
                lever = contacts[deepest, k] - joints[deepest, arm[0]]
                axis = cross(lever, outwards[deepest, k])
                size = float(np.linalg.norm(axis))
                if size > 1e-6:
                    angle = 1.3 * excess[deepest, k] / size * _bump_over(excess[:, k] > 0, round(_AROUND_S * fps))
                    _swing(skeleton, rotations, world, int(arm[0]), axis / size, angle)
    return rotations


def _bump_over(needed: NDArray[np.bool_], margin: int) -> NDArray[np.float64]:
    """(N,) a smooth bump, 1 amid the frames that need it, 0 from `margin` frames outside of them and at the ends."""
    where = np.flatnonzero(needed)
    start, stop = max(where[0] - margin, 0), min(where[-1] + margin, len(needed) - 1)
    s = np.clip((np.arange(len(needed)) - start) / max(stop - start, 1), 0, 1)
    return 64 * (s * (1 - s)) ** 3


def _swing(
    skeleton: Skeleton,
    rotations: NDArray[np.float64],
    world: NDArray[np.float64],
    joint: int,
    axis: NDArray[np.float64],
    angle: NDArray[np.float64],
) -> None:
    """Turns a joint about a world axis (3,) by angles (N,), in place."""
    parent = world[:, int(skeleton.parents[joint])]
    turn = exponential(angle[:, None] * rotate(inverse(parent), axis))
    rotations[:, joint] = multiply(turn, rotations[:, joint])


def nearest_between(
    p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64], s: NDArray[np.float64], samples: int = 200
) -> float:
    """Distance between the segments p-q and r-s by sampling: the plain form of what `arm_depths_kernel` computes."""
    u = np.linspace(0, 1, samples)[:, None]
    return float(np.linalg.norm((p + u * (q - p))[:, None] - (r + u * (s - r))[None], axis=-1).min())


@njit(cache=True)
def _dot(a, b):  # pragma: no cover - compiled
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _minus(a, b):  # pragma: no cover - compiled
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@njit(cache=True)
def _along(a, way, share):  # pragma: no cover - compiled
    return (a[0] + share * way[0], a[1] + share * way[1], a[2] + share * way[2])


@njit(cache=True)
def _nearest(p, d1, r, d2):  # pragma: no cover - compiled
    """Shares of the nearest points of p + u d1 and r + v d2 (C. Ericson, Real-Time Collision Detection, 5.1.9)."""
    w = _minus(p, r)
    a, e, f = max(_dot(d1, d1), 1e-12), max(_dot(d2, d2), 1e-12), _dot(d2, w)
    b, c = _dot(d1, d2), _dot(d1, w)
    below = a * e - b * b
    u = min(max((b * f - c * e) / below, 0.0), 1.0) if below > 1e-12 else 0.0
    v = (b * u + f) / e
    if v < 0:
        v, u = 0.0, min(max(-c / a, 0.0), 1.0)
    elif v > 1:
        v, u = 1.0, min(max((b - c) / a, 0.0), 1.0)
    return u, v


@njit(cache=True)
def _place(joints, n, j):  # pragma: no cover - compiled
    return (joints[n, j, 0], joints[n, j, 1], joints[n, j, 2])


@njit(cache=True)
def arm_depths_kernel(joints, arms, segments, radii):  # pragma: no cover - compiled
    """Depth (N, A) metres of each forearm in the body, the way out (N, A, 3) unit, and the place (N, A, 3) on the arm.

    joints: (N, J, 3); arms: (A, 3); segments: (K, 2); radii: (K + 1,). Negative depths are distances.
    """
    frames, count = joints.shape[0], arms.shape[0]
    depths = np.full((frames, count), -1e9)
    outwards, contacts = np.zeros((frames, count, 3)), np.zeros((frames, count, 3))
    for n in range(frames):
        for k in range(count):
            elbow = _place(joints, n, arms[k, 1])
            forearm = _minus(_place(joints, n, arms[k, 2]), elbow)
            for m in range(segments.shape[0]):
                near = _place(joints, n, segments[m, 0])
                bone = _minus(_place(joints, n, segments[m, 1]), near)
                u, v = _nearest(elbow, forearm, near, bone)
                place = _along(elbow, forearm, u)
                way = _minus(place, _along(near, bone, v))
                distance = np.sqrt(_dot(way, way))
                depth = radii[m] + radii[-1] - distance
                if depth > depths[n, k]:
                    depths[n, k] = depth
                    for i in range(3):
                        outwards[n, k, i] = way[i] / max(distance, 1e-9)
                        contacts[n, k, i] = place[i]
    return depths, outwards, contacts
