"""How far a solved motion is from the true one, in the reconstruction papers' measures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.errors import SettingError
from devices.sample import ROLES
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.skeleton import Skeleton

SKIPPED_S = 0.25
"""Seconds at the start that are not counted."""
LEFT_OUT = ("_end", "Finger", "Thumb", "Index", "HipJoint")
"""Joints whose names have one of these in them are not counted: nothing measures fingers."""


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Means over frames and joints.

    euler_deg: degrees of difference per rotational degree of freedom (ZXY Euler angles, the root's too): the paper's.
    geodesic_deg: degrees between local rotations. mpjpe_cm: centimetres between joints in the world; tracked_cm: the
    same of the six tracker joints. jitter_ratio: third differences of joint positions, solved over true.
    """

    euler_deg: float
    geodesic_deg: float
    mpjpe_cm: float
    tracked_cm: float
    jitter_ratio: float


def accuracy(truth: Motion, solved: Motion) -> Accuracy:
    """Compares two motions of the same joints, frame by frame. Raises SettingError where joints or lengths differ."""
    if not truth.skeleton.same_tree(solved.skeleton):
        raise SettingError(f"{truth.name} and {solved.name} have different joints")
    if len(truth) != len(solved):
        raise SettingError(f"{truth.name} has {len(truth)} frames, its reconstruction {len(solved)}")
    first = min(round(SKIPPED_S * truth.fps), max(len(truth) - 4, 0))
    counted = counted_joints(truth.skeleton)
    real, found = (Rotation.from_quat(m.rotations[first:, counted].reshape(-1, 4)) for m in (truth, solved))
    euler = real.as_euler("ZXY", degrees=True) - found.as_euler("ZXY", degrees=True)
    there, here = (world_joints(m.skeleton, m.root_positions[first:], m.rotations[first:])[0] for m in (truth, solved))
    distance = 100 * np.linalg.norm(there - here, axis=-1)
    tracked = [truth.skeleton.role_joint(role) for role in ROLES]
    return Accuracy(
        euler_deg=float(np.abs((euler + 180) % 360 - 180).mean()),
        geodesic_deg=float(np.degrees((real.inv() * found).magnitude()).mean()),
        mpjpe_cm=float(distance[:, counted].mean()),
        tracked_cm=float(distance[:, tracked].mean()),
        jitter_ratio=_third_differences(here[:, counted]) / max(_third_differences(there[:, counted]), 1e-12),
    )


def counted_joints(skeleton: Skeleton) -> list[int]:
    """The joints that are compared."""
    return [i for i, name in enumerate(skeleton.names) if not any(word in name for word in LEFT_OUT)]


def _third_differences(positions: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.diff(positions, 3, axis=0), axis=-1).mean()) if len(positions) > 3 else 0.0
