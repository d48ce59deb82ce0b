"""Where the body's mass is, by its joints.

D. Winter, "Biomechanics and Motor Control of Human Movement", table 4.1: masses and centres of the segments.
"""

import numpy as np
from numpy.typing import NDArray

from reconstruction.skeleton import Skeleton

_LIMBS = (
    ("upper_arm", "lower_arm", 0.028, 0.436),
    ("lower_arm", "hand", 0.016, 0.430),
    ("hand", "hand", 0.006, 0.0),
    ("upper_leg", "lower_leg", 0.100, 0.433),
    ("lower_leg", "foot", 0.0465, 0.433),
    ("foot", "toes", 0.0145, 0.5),
)
"""Bone, next bone, share of the body's mass, share of the length at which its centre lies."""
_TRUNK_MASS, _HEAD_MASS = 0.497, 0.081


def mass_weights(skeleton: Skeleton) -> NDArray[np.float64]:
    """(J,) weights, together 1, of the joints in the centre of mass; the hips stand in for missing bones."""
    bones, weights = skeleton.humanoid, np.zeros(len(skeleton))
    hips = bones.get("hips", 0)
    segments = [(f"{side}_{a}", f"{side}_{b}", mass, at) for side in ("left", "right") for a, b, mass, at in _LIMBS]
    segments += [("hips", "neck", _TRUNK_MASS, 0.5), ("head", "head", _HEAD_MASS, 0.0)]
    for near, far, mass, share in segments:
        start = bones.get(near, hips)
        weights[start] += mass * (1 - share)
        weights[bones.get(far, start)] += mass * share
    return weights
