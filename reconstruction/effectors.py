"""From measured trackers to the likelihood's effectors: positions, and orientations as points on the axes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES
from reconstruction.likelihood import Effectors
from reconstruction.mounting import Mounting
from reconstruction.rotations import about_up, multiply, rotate
from reconstruction.window_features import seen_from

LEVER_M = 0.1
"""Metres from a tracker to the points on its axes that stand for its orientation."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """positions: (6, 3) metres and orientations: (6, 4), world, NaN where missing;
    position_sigma_m: metres and orientation_sigma: radians, standard deviations."""

    positions: NDArray[np.float64]
    orientations: NDArray[np.float64]
    position_sigma_m: float
    orientation_sigma: float


def and_lost(
    seen: Effectors,
    unseen_s: NDArray[np.float64],
    stray_m_s: float,
    role_joints: NDArray[np.int64],
    mounting: Mounting,
) -> Effectors:
    """Effectors with lost trackers added, for what they still tell of uncertainty: their targets are nowhere.

    unseen_s: (6,) seconds since each was measured, 0 for those that are, infinite for those that never were; stray_m_s:
    how fast the standard deviation of a lost one's place grows.
    """
    lost = (unseen_s > 0) & np.isfinite(unseen_s)
    return Effectors(
        np.concatenate((seen.joints, role_joints[lost])),
        np.concatenate((seen.offsets, mounting.offsets[lost])),
        np.concatenate((seen.targets, np.full((lost.sum(), 3), np.nan))),
        np.concatenate((seen.weights, 1 / (stray_m_s * unseen_s[lost]))),
    )


def and_recalled(
    seen: Effectors,
    lost: NDArray[np.bool_],
    places: NDArray[np.float64],
    sigma_m: NDArray[np.float64],
    role_joints: NDArray[np.int64],
) -> Effectors:
    """Effectors with the joints (L,) of lost roles (6,) added where they are expected, places (L, 3)."""
    if not len(places):
        return seen
    return Effectors(
        np.concatenate((seen.joints, role_joints[lost])),
        np.concatenate((seen.offsets, np.zeros((len(places), 3)))),
        np.concatenate((seen.targets, places)),
        np.concatenate((seen.weights, 1 / sigma_m)),
    )


def effectors(
    measured: Measurement, role_joints: NDArray[np.int64], mounting: Mounting, heading: NDArray[np.float64]
) -> Effectors:
    """The effectors of what was measured, seen from a heading frame (3,).

    role_joints: (6,) the joints that the roles sit on. An orientation whose role has no position counts for nothing.
    """
    here = np.isfinite(measured.positions[:, 0])
    targets = seen_from(measured.positions[None], np.zeros((1, 3)), heading[None])[0]
    turned = here & np.isfinite(measured.orientations[:, 0])
    joints = [role_joints[here]]
    points, wanted = [mounting.offsets[here]], [targets[here]]
    weights = [np.full(here.sum(), 1 / measured.position_sigma_m)]
    if turned.any():
        rotations = _seen_rotations(measured, mounting, heading)[turned]
        for axis in LEVER_M * np.eye(3):
            joints.append(role_joints[turned])
            points.append(mounting.offsets[turned] + axis)
            wanted.append(targets[turned] + rotate(rotations, np.tile(axis, (len(rotations), 1))))
            weights.append(np.full(len(rotations), 1 / (LEVER_M * measured.orientation_sigma)))
    return Effectors(*(np.concatenate(part) for part in (joints, points, wanted, weights)))


def _seen_rotations(measured: Measurement, mounting: Mounting, heading: NDArray[np.float64]) -> NDArray[np.float64]:
    """Measured joint rotations (6, 4), seen from the heading frame."""
    back = np.tile(about_up(-heading[2]), (len(ROLES), 1))
    return multiply(back, mounting.joint_rotations(measured.orientations))
