"""How soft a body is where: a belly gives, a shin does not."""

from collections.abc import Mapping

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

MATERIAL_REGIONS = {
    "head": ("neck", "head"),
    "chest": ("chest", "upper_chest", "shoulder"),
    "belly": ("spine",),
    "hips": ("hips",),
    "arms": ("upper_arm", "lower_arm", "hand"),
    "legs": ("upper_leg", "lower_leg", "foot", "toes"),
}
"""Regions whose flesh is made softer or stiffer as one, and their humanoid bones, left and right alike."""

SOFTEST = 3.0
"""The largest factor on a region's softness."""

_OTHERWISE = 0.5

_RIGID_CELLS = 0.5
_SOFT_CELLS = 2.0
"""Cells from a bone within which flesh is rigid, and from which on it is as soft as it gets."""


def joint_softness(skeleton: Skeleton) -> NDArray[np.float64]:
    """(J,) softness around each joint's bones; joints that have no humanoid name take their parent's."""
    return _by_joint(skeleton, SOFTNESS_OF_BONE, _OTHERWISE)


def joint_factors(skeleton: Skeleton, factors: Mapping[str, float]) -> NDArray[np.float64]:
    """(J,) the factor of each joint's material region; 1 where none is given or the joint is in no region."""
    of_bone = {bone: factors.get(region, 1.0) for region, bones in MATERIAL_REGIONS.items() for bone in bones}
    return _by_joint(skeleton, of_bone, 1.0)


def _by_joint(skeleton: Skeleton, of_bone: Mapping[str, float], otherwise: float) -> NDArray[np.float64]:
    """(J,) the value of each joint's humanoid bone, or its parent's where it is none."""
    by_joint = {
        joint: of_bone[bone.removeprefix("left_").removeprefix("right_")] for bone, joint in skeleton.humanoid.items()
    }
    values = np.empty(len(skeleton))
    for joint, parent in enumerate(skeleton.parents):
        values[joint] = by_joint.get(joint, values[parent] if parent >= 0 else otherwise)
    return values


def particle_softness(
    lattice: Lattice, binding: Binding, bones: Bones, softness_of_joint: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(P,) softness of each particle: of its bones by weight, and none at all within a bone; of joints: (J,)."""
    soft = (softness_of_joint[binding.joints] * binding.weights).sum(axis=1)
    distance = bone_distances(bones, lattice.particles).min(axis=1) / lattice.cell_size
    return soft * np.clip((distance - _RIGID_CELLS) / (_SOFT_CELLS - _RIGID_CELLS), 0, 1)


def scaled_softness(
    softness: NDArray[np.float64], binding: Binding, factors_of_joint: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(P,) softness (P,) times the factors (J,) of each particle's bones by weight, at most 1."""
    return np.minimum(softness * (factors_of_joint[binding.joints] * binding.weights).sum(axis=1), 1.0)
