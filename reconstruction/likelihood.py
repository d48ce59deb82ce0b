"""The likelihood of the paper's eq. 11: how far points on the body stand from where trackers saw them.

E_likelihood(q) = 1/2 sum_e w_e^2 ||f_e(q; s) - c_e||^2 over effectors e, with w_e = 1 / sigma_e.

An effector is a point fixed to a joint: a tracker with its mounting offset. A tracker's orientation counts as three
more points on its axes, so that everything measured is a point.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from reconstruction.body_kinematics import Body, BodyState, place


@dataclass(frozen=True, eq=False)
class Effectors:
    """E points on the body and where they were measured.

    joints: (E,) int64; offsets: (E, 3) metres in the joint's frame;
    targets: (E, 3) metres, in the heading frame of q; weights: (E,) 1/metres, one over the standard deviation.
    """

    joints: NDArray[np.int64]
    offsets: NDArray[np.float64]
    targets: NDArray[np.float64]
    weights: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.joints)


def residuals(effectors: Effectors, state: BodyState) -> NDArray[np.float64]:
    """Weighted residuals (3 E,), unit-free, of a placed body: the plain reference of the kernels."""
    turned = np.einsum("eab,eb->ea", state.world[effectors.joints], effectors.offsets)
    error = state.position[effectors.joints] + turned - effectors.targets
    return (error * effectors.weights[:, None]).ravel()


def energy_and_gradient(
    body: Body, effectors: Effectors, q: NDArray[np.float64], state: BodyState, gradient: NDArray[np.float64]
) -> float:
    """E_likelihood at q (D,); writes its gradient (D,) and leaves `state` at q."""
    place(body, q, state)
    wrench = np.empty((len(body.parents), 6))
    e = effectors
    return gradient_kernel(
        e.joints, e.offsets, e.targets, e.weights, body.parents, body.slots, *_fields(state), wrench, gradient
    )


def jacobian(body: Body, effectors: Effectors, state: BodyState, dof: int) -> NDArray[np.float64]:
    """Derivative (3 E, D) of `residuals` at a placed body."""
    out = np.zeros((3 * len(effectors), dof))
    jacobian_kernel(
        effectors.joints, effectors.offsets, effectors.weights, body.parents, body.slots, *_fields(state), out
    )
    return out


def _fields(state: BodyState) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    return state.position, state.world, state.turn


@njit(cache=True)
def gradient_kernel(joints, offsets, targets, weights, parents, slots, position, world, turn, wrench, gradient):
    """Energy, and its gradient by summing forces and torques from the leaves to the root.

    wrench: (J, 6) room for force and torque about the origin.
    """
    gradient[:] = 0.0
    wrench[:] = 0.0
    value = 0.0
    for e in range(len(joints)):
        j, w = joints[e], weights[e]
        o0, o1, o2 = offsets[e, 0], offsets[e, 1], offsets[e, 2]
        x = position[j, 0] + world[j, 0, 0] * o0 + world[j, 0, 1] * o1 + world[j, 0, 2] * o2
        y = position[j, 1] + world[j, 1, 0] * o0 + world[j, 1, 1] * o1 + world[j, 1, 2] * o2
        z = position[j, 2] + world[j, 2, 0] * o0 + world[j, 2, 1] * o1 + world[j, 2, 2] * o2
        fx, fy, fz = w * (x - targets[e, 0]), w * (y - targets[e, 1]), w * (z - targets[e, 2])
        value += 0.5 * (fx * fx + fy * fy + fz * fz)
        fx, fy, fz = w * fx, w * fy, w * fz
        wrench[j, 0] += fx
        wrench[j, 1] += fy
        wrench[j, 2] += fz
        wrench[j, 3] += y * fz - z * fy
        wrench[j, 4] += z * fx - x * fz
        wrench[j, 5] += x * fy - y * fx
    for j in range(len(parents) - 1, -1, -1):
        fx, fy, fz = wrench[j, 0], wrench[j, 1], wrench[j, 2]
        slot = slots[j]
        if slot >= 0:
            x, y, z = position[j, 0], position[j, 1], position[j, 2]
            tx = wrench[j, 3] - (y * fz - z * fy)
            ty = wrench[j, 4] - (z * fx - x * fz)
            tz = wrench[j, 5] - (x * fy - y * fx)
            for a in range(3):
                gradient[slot + a] = turn[j, 0, a] * tx + turn[j, 1, a] * ty + turn[j, 2, a] * tz
        parent = parents[j]
        if parent >= 0:
            for i in range(6):
                wrench[parent, i] += wrench[j, i]
        else:
            gradient[0], gradient[1], gradient[2] = fx, fy, fz
    return value


@njit(cache=True)
def jacobian_kernel(joints, offsets, weights, parents, slots, position, world, turn, out):
    """Adds the weighted Jacobian of every effector, (3 E, D), into `out`, walking from its joint to the root."""
    for e in range(len(joints)):
        j, w = joints[e], weights[e]
        o0, o1, o2 = offsets[e, 0], offsets[e, 1], offsets[e, 2]
        x = position[j, 0] + world[j, 0, 0] * o0 + world[j, 0, 1] * o1 + world[j, 0, 2] * o2
        y = position[j, 1] + world[j, 1, 0] * o0 + world[j, 1, 1] * o1 + world[j, 1, 2] * o2
        z = position[j, 2] + world[j, 2, 0] * o0 + world[j, 2, 1] * o1 + world[j, 2, 2] * o2
        for r in range(3):
            out[3 * e + r, r] += w
        while j >= 0:
            slot = slots[j]
            if slot >= 0:
                dx, dy, dz = w * (x - position[j, 0]), w * (y - position[j, 1]), w * (z - position[j, 2])
                for a in range(3):
                    ax, ay, az = turn[j, 0, a], turn[j, 1, a], turn[j, 2, a]
                    out[3 * e, slot + a] += ay * dz - az * dy
                    out[3 * e + 1, slot + a] += az * dx - ax * dz
                    out[3 * e + 2, slot + a] += ax * dy - ay * dx
            j = parents[j]
