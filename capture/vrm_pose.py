"""Poses as VRM has them: turns away from the T-pose, each bone seen from the one above it."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.bind_pose import bind_pose
from devices.frame import frozen
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Motion, Pose
from reconstruction.skeleton import Skeleton


def vrm_name(bone: str) -> str:
    """`left_lower_arm` is `leftLowerArm` in VRM 1.0's list of humanoid bones."""
    first, *rest = bone.split("_")
    return first + "".join(part.capitalize() for part in rest)


def vrm_motion(motion: Motion, reference: Pose | None = None) -> Motion:
    """The motion on a skeleton of the humanoid bones alone, called as VRM calls them, whose rest pose is the T-pose.

    reference: any standing pose, needed for skeletons whose rest pose is no pose of a person.
    """
    skeleton = motion.skeleton
    bones = sorted(skeleton.humanoid, key=lambda bone: skeleton.humanoid[bone])
    bones = [bone for bone in bones if bone != "upper_chest" or "chest" in bones]
    joints = np.array([skeleton.humanoid[bone] for bone in bones])
    parents = humanoid_parents(skeleton, joints)
    rest, places = t_pose(skeleton, reference)
    offsets = places[joints] - np.where(parents[:, None] < 0, 0.0, places[joints[np.maximum(parents, 0)]])
    world = world_transforms(skeleton, motion.root_positions, motion.rotations)[:, joints]
    turned = world[..., :3, :3] @ rest[joints].transpose(0, 2, 1)
    local = np.where(
        (parents < 0)[:, None, None], turned, turned[:, np.maximum(parents, 0)].transpose(0, 1, 3, 2) @ turned
    )
    rotations = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(*local.shape[:2], 4)
    normal = Skeleton(tuple(map(vrm_name, bones)), frozen(parents.astype(np.int32)), frozen(offsets))
    return Motion(normal, frozen(world[:, 0, :3, 3].copy()), frozen(rotations), motion.fps, motion.name)


def humanoid_parents(skeleton: Skeleton, joints: NDArray[np.int_]) -> NDArray[np.int_]:
    """For each humanoid joint the number of the nearest one above it among `joints`, -1 for the first."""
    number = {int(joint): index for index, joint in enumerate(joints)}
    parents = []
    for joint in joints:
        above = int(skeleton.parents[joint])
        while above >= 0 and above not in number:
            above = int(skeleton.parents[above])
        parents.append(number.get(above, -1))
    return np.array(parents)


def t_pose(skeleton: Skeleton, reference: Pose | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World rotations (J, 3, 3) and positions (J, 3) of the T-pose: the bind pose with arms level and legs upright."""
    root, rotations = bind_pose(skeleton, reference)
    rotations = rotations.copy()
    for bone, towards, direction in _straight_limbs():
        if bone not in skeleton.humanoid or towards not in skeleton.humanoid:
            continue
        joint, end = skeleton.humanoid[bone], skeleton.humanoid[towards]
        world = world_transforms(skeleton, root, rotations)
        now = world[end, :3, 3] - world[joint, :3, 3]
        if np.linalg.norm(now) < 1e-6:
            continue
        swing = Rotation.align_vectors(direction[None], now[None])[0]
        parent = int(skeleton.parents[joint])
        above = Rotation.from_matrix(world[parent, :3, :3]) if parent >= 0 else Rotation.identity()
        turned = above.inv() * swing * Rotation.from_matrix(world[joint, :3, :3])
        rotations[joint] = turned.as_quat()
    world = world_transforms(skeleton, root, rotations)
    return world[:, :3, :3], world[:, :3, 3]


def _straight_limbs() -> list[tuple[str, str, NDArray[np.float64]]]:
    """Bone, the bone it points at, and the direction (3,) of the T-pose; parents before children."""
    limbs = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm, leg = np.array([sign, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
        limbs += [(f"{side}_upper_arm", f"{side}_lower_arm", arm), (f"{side}_lower_arm", f"{side}_hand", arm)]
        limbs += [(f"{side}_upper_leg", f"{side}_lower_leg", leg), (f"{side}_lower_leg", f"{side}_foot", leg)]
    return limbs
