"""Joint positions of many frames, compiled: `reconstruction.kinematics.world_joints` is its plain form."""

import numpy as np
from numba import njit


@njit(cache=True)
def joint_positions_kernel(parents, offsets, root_positions, rotations):  # pragma: no cover - compiled
    """(N, J, 3) metres and (N, J, 4) world rotations; arguments as those of `world_joints`, the skeleton's first."""
    count, joints = rotations.shape[0], rotations.shape[1]
    positions, world = np.empty((count, joints, 3)), np.empty((count, joints, 4))
    for n in range(count):
        for j in range(joints):
            p, b = parents[j], rotations[n, j]
            if p < 0:
                positions[n, j] = root_positions[n]
                world[n, j] = b
                continue
            a, v = world[n, p], offsets[j]
            tx = 2 * (a[1] * v[2] - a[2] * v[1])
            ty = 2 * (a[2] * v[0] - a[0] * v[2])
            tz = 2 * (a[0] * v[1] - a[1] * v[0])
            positions[n, j, 0] = positions[n, p, 0] + v[0] + a[3] * tx + a[1] * tz - a[2] * ty
            positions[n, j, 1] = positions[n, p, 1] + v[1] + a[3] * ty + a[2] * tx - a[0] * tz
            positions[n, j, 2] = positions[n, p, 2] + v[2] + a[3] * tz + a[0] * ty - a[1] * tx
            world[n, j, 0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1]
            world[n, j, 1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0]
            world[n, j, 2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3]
            world[n, j, 3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]
    return positions, world
