"""Forward kinematics: `f(q; s)` of the reconstruction paper's eq. 11, from local rotations to the world."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from reconstruction.skeleton import Skeleton


def world_joints(
    skeleton: Skeleton, root_positions: NDArray[np.float64], rotations: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World joint positions (..., J, 3) metres and world rotations (..., J, 3, 3).

    root_positions: (..., 3) metres; rotations: (..., J, 4) local unit quaternions (x, y, z, w).
    """
    batch = rotations.shape[:-2]
    local = Rotation.from_quat(rotations.reshape(-1, 4)).as_matrix().reshape(*batch, len(skeleton), 3, 3)
    position = np.empty((*batch, len(skeleton), 3))
    world = np.empty_like(local)
    for joint, parent in enumerate(skeleton.parents):
        if parent < 0:
            position[..., joint, :], world[..., joint, :, :] = root_positions, local[..., joint, :, :]
        else:
            position[..., joint, :] = position[..., parent, :] + world[..., parent, :, :] @ skeleton.offsets[joint]
            world[..., joint, :, :] = world[..., parent, :, :] @ local[..., joint, :, :]
    return position, world


def world_transforms(
    skeleton: Skeleton, root_positions: NDArray[np.float64], rotations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """`T_world_joint`, (..., J, 4, 4), for the same arguments as `world_joints`."""
    position, rotation = world_joints(skeleton, root_positions, rotations)
    transform = np.zeros((*position.shape[:-1], 4, 4))
    transform[..., :3, :3], transform[..., :3, 3], transform[..., 3, 3] = rotation, position, 1
    return transform
