"""The body of our own making: one T-posed skeleton for any stature, in published proportions."""

import numpy as np

from reconstruction.skeleton import Skeleton

_PROPORTIONS: tuple[tuple[str, str | None, tuple[float, float, float]], ...] = (
    ("Hips", None, (0.0, 0.545, 0.0)),
    ("LeftUpLeg", "Hips", (0.052, -0.025, 0.0)),
    ("LeftLeg", "LeftUpLeg", (0.0, -0.235, 0.0)),
    ("LeftFoot", "LeftLeg", (0.0, -0.246, 0.0)),
    ("LeftToeBase", "LeftFoot", (0.0, -0.027, 0.085)),
    ("LeftToeBase_end", "LeftToeBase", (0.0, -0.006, 0.042)),
    ("RightUpLeg", "Hips", (-0.052, -0.025, 0.0)),
    ("RightLeg", "RightUpLeg", (0.0, -0.235, 0.0)),
    ("RightFoot", "RightLeg", (0.0, -0.246, 0.0)),
    ("RightToeBase", "RightFoot", (0.0, -0.027, 0.085)),
    ("RightToeBase_end", "RightToeBase", (0.0, -0.006, 0.042)),
    ("Spine", "Hips", (0.0, 0.055, -0.008)),
    ("Spine1", "Spine", (0.0, 0.070, -0.004)),
    ("Spine2", "Spine1", (0.0, 0.080, 0.0)),
    ("Neck", "Spine2", (0.0, 0.100, 0.0)),
    ("Head", "Neck", (0.0, 0.050, 0.012)),
    ("Head_end", "Head", (0.0, 0.100, 0.004)),
    ("LeftShoulder", "Spine2", (0.018, 0.075, 0.006)),
    ("LeftArm", "LeftShoulder", (0.100, -0.007, -0.010)),
    ("LeftForeArm", "LeftArm", (0.186, 0.0, 0.0)),
    ("LeftHand", "LeftForeArm", (0.146, 0.0, 0.0)),
    ("LeftHand_end", "LeftHand", (0.100, 0.0, 0.0)),
    ("RightShoulder", "Spine2", (-0.018, 0.075, 0.006)),
    ("RightArm", "RightShoulder", (-0.100, -0.007, -0.010)),
    ("RightForeArm", "RightArm", (-0.186, 0.0, 0.0)),
    ("RightHand", "RightForeArm", (-0.146, 0.0, 0.0)),
    ("RightHand_end", "RightHand", (-0.100, 0.0, 0.0)),
)
"""Joint, parent, and offset from it as a share of stature: limb lengths and joint heights after Drillis and Contini
(1966) as printed in Winter, Biomechanics and Motor Control of Human Movement; the spine is cut at even heights."""


def standard_skeleton(stature_m: float = 1.75) -> Skeleton:
    """The T-posed skeleton (J = 27, end sites included) of a person of that stature, facing +Z; joints in metres.

    The root's offset is the height of the hips above the floor.
    """
    names = tuple(name for name, _, _ in _PROPORTIONS)
    parents = np.array([-1 if parent is None else names.index(parent) for _, parent, _ in _PROPORTIONS], np.int32)
    offsets = np.array([offset for _, _, offset in _PROPORTIONS]) * stature_m
    return Skeleton(names, parents, offsets)
