"""Two-bone legs that reach for where the ankle should be: how planted feet are held."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from reconstruction.kinematics import world_joints
from reconstruction.rotations import inverse, multiply, rotate
from reconstruction.skeleton import Skeleton
from reconstruction.transition.clip import Leg

SOFT_FROM = (0.97, 0.98)
"""From a share of its length between these on a leg stretches ever less: the knee does not snap straight."""
_UNTOUCHED_M = 0.01
"""A leg that is within about so much of where it should reach is left as straight as it is."""
_HINGE_SHARE = 0.1
"""How much the leg's usual bending axis counts beside the present one, which a straight leg does not have."""


def reach_legs(
    skeleton: Skeleton,
    legs: tuple[Leg, ...],
    root_positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
    ankles: NDArray[np.float64],
    feet: NDArray[np.float64],
    hinges: NDArray[np.float64],
    seam: NDArray[np.float64],
    soft_from: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Rotations (N, J, 4) whose ankles come to `ankles` (N, F, 3) metres, feet turned as `feet` (N, F, 4), world.

    The knee bends in the plane it bends in already; then the hip turns the least that aims the leg. Where a leg would
    have to be longer than it is, the ankle stays on the line from the hip. hinges: (F, 3) each leg's usual bending
    axis in the thigh's axes; seam: (N,) 1 where a leg may be as straight as it is, 0 where it is kept from snapping
    straight; soft_from: (F,) the share of its length from which on each leg is. Plain form of `reach_legs_kernel`.
    """
    result = rotations.copy()
    for f, leg in enumerate(legs):
        joints, _ = world_joints(skeleton, root_positions, result)
        hip, knee, ankle = joints[:, leg.hip], joints[:, leg.knee], joints[:, leg.ankle]
        thigh = float(np.linalg.norm(skeleton.offsets[leg.knee]))
        shin = float(np.linalg.norm(skeleton.offsets[leg.ankle]))
        now = np.linalg.norm(ankle - hip, axis=-1)
        wanted = np.linalg.norm(ankles[:, f] - hip, axis=-1)
        length = thigh + shin
        soft = float(soft_from[f])
        kept = np.maximum(seam, np.exp(-(((wanted - now) / _UNTOUCHED_M) ** 2)))
        to = _soft(wanted, length, soft) + kept * (now - _soft(now, length, soft))
        to = np.maximum(to, abs(thigh - shin) + 0.02 * length)
        world = _world(skeleton, result, leg.hip)
        parent = multiply(world, inverse(result[:, leg.hip]))
        axis, side = _bend_axis(hip, knee, ankle, rotate(world, hinges[f]), thigh * shin)
        bend = _bend(thigh, shin, to) - side * _bend(thigh, shin, now)
        local_axis = rotate(inverse(multiply(world, result[:, leg.knee])), axis)
        result[:, leg.knee] = multiply(result[:, leg.knee], _about(local_axis, bend))
        reached = rotate(world, skeleton.offsets[leg.knee] + rotate(result[:, leg.knee], skeleton.offsets[leg.ankle]))
        world = multiply(_shortest(reached, ankles[:, f] - hip), world)
        result[:, leg.hip] = multiply(inverse(parent), world)
        result[:, leg.ankle] = multiply(inverse(multiply(world, result[:, leg.knee])), feet[:, f])
    return result


def _soft(distance: NDArray[np.float64], length: float, soft_from: float) -> NDArray[np.float64]:
    """Maps 0 ... infinity to 0 ... length: the same up to that share of it, then ever slower."""
    over = np.maximum(distance / length - soft_from, 0) / (1 - soft_from)
    return np.where(over > 0, length * (1 - (1 - soft_from) * np.exp(-over)), distance)


def _bend(thigh: float, shin: float, distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far the knee is from straight, radians, by the law of cosines."""
    return np.pi - np.arccos(np.clip((thigh**2 + shin**2 - distance**2) / (2 * thigh * shin), -1, 1))


def _bend_axis(
    hip: NDArray[np.float64],
    knee: NDArray[np.float64],
    ankle: NDArray[np.float64],
    hinge: NDArray[np.float64],
    scale: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 3) the world axis about which the knee bends, and (N,) -1 where it is bent the wrong way, else 1."""
    axis = np.cross(knee - hip, ankle - knee)
    side = np.where(np.sum(axis * hinge, axis=-1) < 0, -1.0, 1.0)
    axis = side[:, None] * axis + _HINGE_SHARE * scale * hinge
    return axis / np.linalg.norm(axis, axis=-1, keepdims=True), side


def _about(axis: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([axis * np.sin(angle / 2)[:, None], np.cos(angle / 2)[:, None]], axis=-1)


def _shortest(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 4) the least rotation that points `a` along `b`, both (N, 3)."""
    sizes = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    q = np.concatenate([np.cross(a, b), (sizes + np.sum(a * b, axis=-1))[:, None]], axis=-1)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def _world(skeleton: Skeleton, rotations: NDArray[np.float64], joint: int) -> NDArray[np.float64]:
    world = rotations[:, joint]
    while (joint := int(skeleton.parents[joint])) >= 0:
        world = multiply(rotations[:, joint], world)
    return world


@njit(cache=True)
def _mul(a, b):  # pragma: no cover - compiled
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@njit(cache=True)
def _inv(q):  # pragma: no cover - compiled
    return (-q[0], -q[1], -q[2], q[3])


@njit(cache=True)
def _cross(a, b):  # pragma: no cover - compiled
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(cache=True)
def _turn(q, v):  # pragma: no cover - compiled
    u = (q[0], q[1], q[2])
    t = _cross(u, v)
    t = (2 * t[0], 2 * t[1], 2 * t[2])
    c = _cross(u, t)
    return (v[0] + q[3] * t[0] + c[0], v[1] + q[3] * t[1] + c[1], v[2] + q[3] * t[2] + c[2])


@njit(cache=True)
def _size(v):  # pragma: no cover - compiled
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@njit(cache=True)
def _knee_bend(thigh, shin, distance):  # pragma: no cover - compiled
    return np.pi - np.arccos(max(-1.0, min(1.0, (thigh**2 + shin**2 - distance**2) / (2 * thigh * shin))))


@njit(cache=True)
def _stretch(distance, length, soft_from):  # pragma: no cover - compiled
    over = max(distance / length - soft_from, 0.0) / (1 - soft_from)
    return length * (1 - (1 - soft_from) * np.exp(-over)) if over > 0 else distance


@njit(cache=True)
def _row3(array, n):  # pragma: no cover - compiled
    return (array[n, 0], array[n, 1], array[n, 2])


@njit(cache=True)
def _row4(array, n):  # pragma: no cover - compiled
    return (array[n, 0], array[n, 1], array[n, 2], array[n, 3])


@njit(cache=True)
def reach_legs_kernel(
    parents, offsets, legs, root_positions, rotations, ankles, feet, hinges, seam, soft_from
):  # pragma: no cover - compiled
    """`reach_legs` in place on `rotations`; parents: (J,), offsets: (J, 3), legs: (F, 3) hip, knee and ankle joints."""
    chain = np.empty(len(parents), np.int64)
    for f in range(legs.shape[0]):
        hip, knee, ankle = legs[f, 0], legs[f, 1], legs[f, 2]
        depth, joint = 0, parents[hip]
        while joint >= 0:
            chain[depth] = joint
            depth, joint = depth + 1, parents[joint]
        shin_offset, foot_offset = _row3(offsets, knee), _row3(offsets, ankle)
        thigh, shin = _size(shin_offset), _size(foot_offset)
        length = thigh + shin
        for n in range(rotations.shape[0]):
            local = rotations[n]
            position, parent = _row3(root_positions, n), _row4(local, chain[depth - 1])
            for k in range(depth - 1, -1, -1):
                below = chain[k - 1] if k > 0 else hip
                step = _turn(parent, _row3(offsets, below))
                position = (position[0] + step[0], position[1] + step[1], position[2] + step[2])
                if k > 0:
                    parent = _mul(parent, _row4(local, below))
            world = _mul(parent, _row4(local, hip))
            bend_q = _row4(local, knee)
            thigh_v = _turn(world, shin_offset)
            shin_v = _turn(_mul(world, bend_q), foot_offset)
            now = _size((thigh_v[0] + shin_v[0], thigh_v[1] + shin_v[1], thigh_v[2] + shin_v[2]))
            aim = (
                ankles[n, f, 0] - position[0],
                ankles[n, f, 1] - position[1],
                ankles[n, f, 2] - position[2],
            )
            soft = soft_from[f]
            kept = max(seam[n], np.exp(-(((_size(aim) - now) / _UNTOUCHED_M) ** 2)))
            to = _stretch(_size(aim), length, soft) + kept * (now - _stretch(now, length, soft))
            to = max(to, abs(thigh - shin) + 0.02 * length)
            axis, hinge = _cross(thigh_v, shin_v), _turn(world, _row3(hinges, f))
            side = -1.0 if axis[0] * hinge[0] + axis[1] * hinge[1] + axis[2] * hinge[2] < 0 else 1.0
            share = _HINGE_SHARE * thigh * shin
            axis = (
                side * axis[0] + share * hinge[0],
                side * axis[1] + share * hinge[1],
                side * axis[2] + share * hinge[2],
            )
            size = _size(axis)
            axis = _turn(_inv(_mul(world, bend_q)), (axis[0] / size, axis[1] / size, axis[2] / size))
            half = (_knee_bend(thigh, shin, to) - side * _knee_bend(thigh, shin, now)) / 2
            sine = np.sin(half)
            bend_q = _mul(bend_q, (axis[0] * sine, axis[1] * sine, axis[2] * sine, np.cos(half)))
            reached = _turn(bend_q, foot_offset)
            reached = _turn(
                world,
                (shin_offset[0] + reached[0], shin_offset[1] + reached[1], shin_offset[2] + reached[2]),
            )
            swing = _cross(reached, aim)
            dot = reached[0] * aim[0] + reached[1] * aim[1] + reached[2] * aim[2]
            w = _size(reached) * _size(aim) + dot
            size = max(np.sqrt(swing[0] ** 2 + swing[1] ** 2 + swing[2] ** 2 + w * w), 1e-12)
            world = _mul((swing[0] / size, swing[1] / size, swing[2] / size, w / size), world)
            hip_q = _mul(_inv(parent), world)
            foot_q = _mul(_inv(_mul(world, bend_q)), _row4(feet[n], f))
            for k in range(4):
                rotations[n, hip, k], rotations[n, knee, k], rotations[n, ankle, k] = hip_q[k], bend_q[k], foot_q[k]
