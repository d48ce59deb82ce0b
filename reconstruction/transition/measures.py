"""How good a seam is: angular acceleration and jerk, feet that slide, a floor that is crossed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.rotations import inverse, logarithm, multiply
from reconstruction.transition.clip import Leg, TransitionClip, legs_of

SKATE_HEIGHT_M = 0.025


@dataclass(frozen=True, slots=True)
class SeamFigures:
    """Of the frames from the one left to the one entered.

    peak_acceleration: rad/s^2, peak_jerk: rad/s^3, the largest of any joint; slide_m_s: mean skating speed of the
    ankles; penetration_m: how far a foot goes below the floor in the frames
    between, which are not the clips' own.
    """

    peak_acceleration: float
    peak_jerk: float
    slide_m_s: float
    penetration_m: float


def seam_figures(motion: Motion, first: int, last: int, floor_m: float, ankle_rest_m: float) -> SeamFigures:
    """The figures of frames `first` to `last` (the frames left and entered) of a joined motion."""
    low, high = max(first - 2, 0), min(last + 3, len(motion))
    rotations = motion.rotations[low:high, ~motion.skeleton.is_end]
    steps = logarithm(multiply(inverse(rotations[:-1]), rotations[1:])) * motion.fps
    acceleration = np.diff(steps, axis=0) * motion.fps
    jerk = np.diff(acceleration, axis=0) * motion.fps
    inner = acceleration[max(first - 1 - low, 0) : last - low]
    legs = legs_of(motion.skeleton)
    joints, _ = world_joints(motion.skeleton, motion.root_positions[low:high], motion.rotations[low:high])
    return SeamFigures(
        float(np.linalg.norm(inner, axis=-1).max(initial=0)),
        float(np.linalg.norm(jerk, axis=-1).max(initial=0)),
        float(skate(joints, legs, ankle_rest_m, motion.fps)[max(first - low, 0) : last - low].mean()) if legs else 0.0,
        float(penetration(joints[first + 1 - low : last - low], legs, floor_m).max(initial=0)),
    )


def skate(joints: NDArray[np.float64], legs: tuple[Leg, ...], rest_m: float, fps: float) -> NDArray[np.float64]:
    """(T - 1,) m/s: the ankles' speed over the ground, weighed by how near to it they are, summed over the feet.

    Zhang, Starke, Komura, Saito, "Mode-Adaptive Neural Networks for Quadruped Motion Control", 2018, section 8:
    `v (2 - 2^(h / H))` for heights h between 0 and H; h counts from the height at which a planted ankle stands.
    """
    ankles = joints[:, [leg.ankle for leg in legs]]
    speed = np.linalg.norm(np.diff(ankles[..., [0, 2]], axis=0), axis=-1) * fps
    height = np.clip((np.minimum(ankles[1:, :, 1], ankles[:-1, :, 1]) - rest_m) / SKATE_HEIGHT_M, 0, 1)
    return (speed * (2 - 2**height)).sum(axis=-1)


def penetration(joints: NDArray[np.float64], legs: tuple[Leg, ...], floor_m: float) -> NDArray[np.float64]:
    """(T,) metres of the lowest joint of the feet below the floor, 0 above it."""
    if not legs:
        return np.zeros(len(joints))
    feet = [joint for leg in legs for joint in (leg.ankle, *leg.toes)]
    return np.maximum(floor_m - joints[:, feet, 1].min(axis=1), 0)


def ankle_rest(clip: TransitionClip) -> float:
    """Metres: the height at which the clip's ankles stand, their 5th percentile."""
    if not clip.legs:
        return 0.0
    return float(np.percentile(clip.joints[:, [leg.ankle for leg in clip.legs], 1], 5))


def own_slide(clip: TransitionClip) -> float:
    """m/s: the mean skating speed of a clip by itself."""
    if not clip.legs or len(clip) < 2:
        return 0.0
    return float(skate(clip.joints, clip.legs, ankle_rest(clip), clip.fps).mean())
