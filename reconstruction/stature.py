"""How tall the person of a skeleton is, and the same skeleton at another stature."""

from dataclasses import replace
from functools import cache

import numpy as np

from devices.frame import frozen
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton


def stature(skeleton: Skeleton) -> float:
    """Metres: ankle to hip and hips to head along the bones, by their share in the standard body's stature."""
    return _standing_length(skeleton) / _standard_share()


def scaled_to_stature(skeleton: Skeleton, stature_m: float) -> Skeleton:
    """The same proportions at that stature (metres)."""
    return replace(skeleton, offsets=frozen(skeleton.offsets * (stature_m / stature(skeleton))))


@cache
def _standard_share() -> float:
    return _standing_length(standard_skeleton(1.0))


def _standing_length(skeleton: Skeleton) -> float:
    """Metres from the left ankle to the hip joint and from the hips to the head joint, along the bones."""
    bones = skeleton.humanoid
    return _chain(skeleton, bones["left_foot"], bones["left_upper_leg"]) + _chain(
        skeleton, bones["head"], bones["hips"]
    )


def _chain(skeleton: Skeleton, end: int, start: int) -> float:
    """Metres along the bones from joint `start` down to its descendant `end`."""
    length, joint = 0.0, end
    while joint not in (start, -1):
        length += float(np.linalg.norm(skeleton.offsets[joint]))
        joint = int(skeleton.parents[joint])
    return length
