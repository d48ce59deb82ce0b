"""How soft a body is where: a belly gives, a shin does not."""

import numpy as np
from numpy.typing import NDArray

from deformation.heat_weights import Bones, bone_distances
from deformation.lattice import Lattice
from deformation.skinning import Binding
from reconstruction.skeleton import Skeleton

SOFTNESS_OF_BONE = {
    "hips": 0.75,
    "spine": 1.0,
    "chest": 0.85,
    "upper_chest": 0.85,
    "neck": 0.15,
    "head": 0.05,
    "shoulder": 0.4,
    "upper_arm": 0.35,
    "lower_arm": 0.15,
    "hand": 0.0,
    "upper_leg": 0.5,
    "lower_leg": 0.25,
    "foot": 0.0,
    "toes": 0.0,
}
"""Softness of the flesh around each humanoid bone, left and right alike."""

_OTHERWISE = 0.5

_RIGID_CELLS = 0.5
_SOFT_CELLS = 2.0
"""Cells from a bone within which flesh is rigid, and from which on it is as soft as it gets."""


def joint_softness(skeleton: Skeleton) -> NDArray[np.float64]:
    """(J,) softness around each joint's bones; joints that have no humanoid name take their parent's."""
    by_joint = {
        joint: SOFTNESS_OF_BONE[bone.removeprefix("left_").removeprefix("right_")]
        for bone, joint in skeleton.humanoid.items()
    }
    soft = np.empty(len(skeleton))
    for joint, parent in enumerate(skeleton.parents):
        soft[joint] = by_joint.get(joint, soft[parent] if parent >= 0 else _OTHERWISE)
    return soft


def default_softness(lattice: Lattice, binding: Binding, skeleton: Skeleton, bones: Bones) -> NDArray[np.float64]:
    """(P,) softness of each particle: of its bones by weight, and none at all within a bone."""
    soft = (joint_softness(skeleton)[binding.joints] * binding.weights).sum(axis=1)
    distance = bone_distances(bones, lattice.particles).min(axis=1) / lattice.cell_size
    return soft * np.clip((distance - _RIGID_CELLS) / (_SOFT_CELLS - _RIGID_CELLS), 0, 1)
