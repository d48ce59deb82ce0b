"""The lengths of a body that calibration fits, and the body that has them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from reconstruction.skeleton import Skeleton

SEGMENTS = {
    "thighs": ("left_lower_leg", "right_lower_leg"),
    "shins": ("left_foot", "right_foot"),
    "hips": ("left_upper_leg", "right_upper_leg"),
    "torso": ("spine", "chest", "upper_chest", "neck"),
    "head": ("head",),
    "shoulders": ("left_upper_arm", "right_upper_arm"),
    "upper arms": ("left_lower_arm", "right_lower_arm"),
    "forearms": ("left_hand", "right_hand"),
}
"""Lengths that are fitted, and the humanoid bones whose offsets each scales: left and right are alike."""

NAMES = ("stature", *SEGMENTS)
"""All scales: the first is that of the whole body, and the others are ratios to it."""

LEGS = ("stature", "thighs", "shins")
"""Scales that change how high the hips stand."""


def scaled(body: Skeleton, scales: Mapping[str, float]) -> Skeleton:
    """The body with its segments scaled; segments not named keep the stature's scale."""
    ratio = np.full(len(body), scales.get("stature", 1.0))
    for name, bones in SEGMENTS.items():
        for bone in bones:
            if bone in body.humanoid:
                ratio[body.humanoid[bone]] *= scales.get(name, 1.0)
    return replace(body, offsets=body.offsets * ratio[:, None])
