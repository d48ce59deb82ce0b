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
    slide_cm_s: how fast the solved ankles move along the floor while the true ones are planted, centimetres a second,
    and true_slide_cm_s how fast the true ones do; both 0 where none is ever planted.
    """

    euler_deg: float
    geodesic_deg: float
    mpjpe_cm: float
    tracked_cm: float
    jitter_ratio: float
    slide_cm_s: float
    true_slide_cm_s: float


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
    ankles = [truth.skeleton.role_joint(role) for role in ("left_ankle", "right_ankle")]
    planted = _planted(there[:, ankles], truth.fps)
    return Accuracy(
        euler_deg=float(np.abs((euler + 180) % 360 - 180).mean()),
        geodesic_deg=float(np.degrees((real.inv() * found).magnitude()).mean()),
        mpjpe_cm=float(distance[:, counted].mean()),
        tracked_cm=float(distance[:, tracked].mean()),
        jitter_ratio=_third_differences(here[:, counted]) / max(_third_differences(there[:, counted]), 1e-12),
        slide_cm_s=_slide_cm_s(here[:, ankles], planted, truth.fps),
        true_slide_cm_s=_slide_cm_s(there[:, ankles], planted, truth.fps),
    )


def share_within_sigma(truth: Motion, solved: Motion, sigma: NDArray[np.float64]) -> float:
    """Share of counted joints, over all frames, that turn and are no farther from the true local rotation than their
    standard deviation sigma (T, J) radians says; near 0.68 where it is right."""
    first = min(round(SKIPPED_S * truth.fps), max(len(truth) - 4, 0))
    counted = counted_joints(truth.skeleton)
    real, found = (Rotation.from_quat(m.rotations[first:, counted].reshape(-1, 4)) for m in (truth, solved))
    off = (real.inv() * found).magnitude().reshape(-1, len(counted))
    said = sigma[first:, counted]
    return float(np.mean((off <= said)[said > 0]))


def counted_joints(skeleton: Skeleton) -> list[int]:
    """The joints that are compared."""
    return [i for i, name in enumerate(skeleton.names) if not any(word in name for word in LEFT_OUT)]


def _third_differences(positions: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.diff(positions, 3, axis=0), axis=-1).mean()) if len(positions) > 3 else 0.0


def _planted(ankles: NDArray[np.float64], fps: float) -> NDArray[np.bool_]:
    """(T - 1, A) when an ankle (T, A, 3) metres stands: slower than 10 cm/s, and within 12 cm of its lowest place."""
    slow = np.linalg.norm(np.diff(ankles, axis=0), axis=-1) * fps < 0.1
    return slow & (ankles[1:, :, 1] < ankles[..., 1].min(axis=0) + 0.12)


def _slide_cm_s(ankles: NDArray[np.float64], planted: NDArray[np.bool_], fps: float) -> float:
    """Mean speed of ankles (T, A, 3) metres along the floor, centimetres a second, while planted (T - 1, A)."""
    speed = 100 * fps * np.linalg.norm(np.diff(ankles[..., [0, 2]], axis=0), axis=-1)
    return float(speed[planted].mean()) if planted.any() else 0.0
