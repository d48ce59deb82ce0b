"""How tall the person of a skeleton is, and the same skeleton at another stature.

Files agree on where hip, knee and ankle are; where a trunk begins and which joint is the head's differs by more than
people do (CMU's head joint sits low in the neck). So the legs alone tell.
"""

from dataclasses import replace

import numpy as np

from devices.errors import SixpointError
from devices.frame import frozen
from reconstruction.skeleton import Skeleton

LEG_SHARE = 0.481
"""Hip joint to ankle as a share of stature (Drillis and Contini 1966, in Winter)."""


def stature(skeleton: Skeleton) -> float:
    """Metres: hip joint to ankle along the bones, the mean of both legs, by its share in a person's stature.

    Raises SixpointError where there is no leg.
    """
    bones = skeleton.humanoid
    lengths = [
        _chain(skeleton, bones[f"{side}_upper_leg"], bones[f"{side}_foot"])
        for side in ("left", "right")
        if f"{side}_upper_leg" in bones and f"{side}_foot" in bones
    ]
    if not lengths:
        raise SixpointError(f"the skeleton has no leg from hip to ankle: its joints are {', '.join(skeleton.names)}")
    return float(np.mean(lengths)) / LEG_SHARE


def scaled_to_stature(skeleton: Skeleton, stature_m: float) -> Skeleton:
    """The same proportions at that stature (metres)."""
    return replace(skeleton, offsets=frozen(skeleton.offsets * (stature_m / stature(skeleton))))


def _chain(skeleton: Skeleton, top: int, joint: int) -> float:
    """Metres along the bones from joint `top` down to its descendant."""
    length = 0.0
    while joint != top and joint >= 0:
        length += float(np.linalg.norm(skeleton.offsets[joint]))
        joint = int(skeleton.parents[joint])
    return length
