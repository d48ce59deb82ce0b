"""Forward kinematics f(q; s) of the paper's eq. 11 with its derivatives, for one q at solver speed.

The kernels write into arrays given to them and allocate nothing. `kinematics.world_joints` on
`PoseSpace.rotations` is the plain reference that tests hold them to.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from reconstruction.pose_space import ROOT_DOF, PoseSpace


@dataclass(frozen=True, eq=False)
class Body:
    """A pose space as the kernels take it, for J joints.

    parents: (J,) int64; offsets: (J, 3) metres; mean: (J, 3, 3) mean rotations;
    slots: (J,) int64, where in q a joint's rotation vector starts, -1 for joints that never turn.
    """

    parents: NDArray[np.int64]
    offsets: NDArray[np.float64]
    mean: NDArray[np.float64]
    slots: NDArray[np.int64]

    @classmethod
    def of(cls, space: PoseSpace) -> "Body":
        """The body of a pose space.

        Its arrays are its own, contiguous and writable, whatever the skeleton's are: the kernels are compiled once for
        every type of array, and one more would be compiled or loaded in the middle of a session.
        """
        slots = np.full(len(space.skeleton), -1, np.int64)
        slots[0] = 3
        slots[space.moving] = ROOT_DOF + 3 * np.arange(len(space.moving))
        return cls(
            space.skeleton.parents.astype(np.int64),
            np.array(space.skeleton.offsets, np.float64, order="C"),
            np.array(Rotation.from_quat(space.mean).as_matrix(), order="C"),
            slots,
        )


@dataclass(frozen=True, eq=False)
class BodyState:
    """Room for one evaluation; every term of the energy reads it after one run of `place`.

    position: (J, 3) metres and world: (J, 3, 3), in the heading frame that q is seen from;
    turn: (J, 3, 3), column a is the world rotation rate per unit change of a joint's rotation-vector component a.
    """

    position: NDArray[np.float64]
    world: NDArray[np.float64]
    turn: NDArray[np.float64]

    @classmethod
    def of(cls, joints: int) -> "BodyState":
        """Room for that many joints."""
        return cls(np.empty((joints, 3)), np.empty((joints, 3, 3)), np.empty((joints, 3, 3)))


def place(body: Body, q: NDArray[np.float64], state: BodyState) -> None:
    """Fills `state` with the body at q (D,)."""
    place_kernel(q, body.parents, body.offsets, body.mean, body.slots, state.position, state.world, state.turn)


def joint_positions(body: Body, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joint positions (T, J, 3) metres in the heading frame of each q (T, D)."""
    out = np.empty((len(q), len(body.parents), 3))
    positions_kernel(np.ascontiguousarray(q, np.float64), body.parents, body.offsets, body.mean, body.slots, out)
    return out


@njit(cache=True)
def place_kernel(q, parents, offsets, mean, slots, position, world, turn):
    """Positions, world rotations and turn axes of all joints; see `Body` and `BodyState`."""
    for j in range(len(parents)):
        slot = slots[j]
        a = b = c = 0.0
        if slot >= 0:
            a, b, c = q[slot], q[slot + 1], q[slot + 2]
        square = a * a + b * b + c * c
        if square > 1e-8:
            angle = np.sqrt(square)
            sine = np.sin(angle)
            s, h = sine / angle, (1 - np.cos(angle)) / square
            k = (1 - s) / square
        else:
            s, h, k = 1 - square / 6, 0.5 - square / 24, 1 / 6 - square / 120
        # Rodrigues: exp(w) = I + s [w] + h [w]^2; left Jacobian: I + h [w] + k [w]^2.
        e = _of_cross(a, b, c, s, h)
        t = _of_cross(a, b, c, h, k)
        parent = parents[j]
        if parent < 0:
            for r in range(3):
                position[j, r] = q[r]
                for col in range(3):
                    turn[j, r, col] = t[3 * r + col]
                    total = 0.0
                    for i in range(3):
                        total += e[3 * r + i] * mean[j, i, col]
                    world[j, r, col] = total
            continue
        for r in range(3):
            p0, p1, p2 = world[parent, r, 0], world[parent, r, 1], world[parent, r, 2]
            position[j, r] = position[parent, r] + p0 * offsets[j, 0] + p1 * offsets[j, 1] + p2 * offsets[j, 2]
            b0 = p0 * mean[j, 0, 0] + p1 * mean[j, 1, 0] + p2 * mean[j, 2, 0]
            b1 = p0 * mean[j, 0, 1] + p1 * mean[j, 1, 1] + p2 * mean[j, 2, 1]
            b2 = p0 * mean[j, 0, 2] + p1 * mean[j, 1, 2] + p2 * mean[j, 2, 2]
            for col in range(3):
                world[j, r, col] = b0 * e[col] + b1 * e[3 + col] + b2 * e[6 + col]
                turn[j, r, col] = b0 * t[col] + b1 * t[3 + col] + b2 * t[6 + col]


@njit(cache=True, inline="always")
def _of_cross(a, b, c, first, second):
    """I + first [w] + second [w]^2 as nine numbers, row by row, for w = (a, b, c)."""
    ab, ac, bc = second * a * b, second * a * c, second * b * c
    return (
        1 - second * (b * b + c * c),
        ab - first * c,
        ac + first * b,
        ab + first * c,
        1 - second * (a * a + c * c),
        bc - first * a,
        ac - first * b,
        bc + first * a,
        1 - second * (a * a + b * b),
    )


@njit(cache=True)
def positions_kernel(q, parents, offsets, mean, slots, out):
    """Joint positions (T, J, 3) of q (T, D), one after the other."""
    joints = len(parents)
    world, turn = np.empty((joints, 3, 3)), np.empty((joints, 3, 3))
    for t in range(len(q)):
        place_kernel(q[t], parents, offsets, mean, slots, out[t], world, turn)
