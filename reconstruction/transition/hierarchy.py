"""Which interpolation each joint gets, and how fast it runs: the paper's section 5.2 and 5.3."""

import re

import numpy as np
from numpy.typing import NDArray

from reconstruction.interpolation import normalised_lerp, slerp, squad
from reconstruction.rotations import inverse, logarithm, multiply
from reconstruction.skeleton import Skeleton
from reconstruction.transition.classification import MotionClass

LARGE_ANGLE = np.pi / 6
"""Section 5.3.1: joints that turn so far or farther get squad."""
_FINGER = re.compile(r"finger|thumb|index|middle|ring|pinky|little", re.IGNORECASE)


def finger_joints(skeleton: Skeleton) -> NDArray[np.bool_]:
    """(J,) True for joints of the fingers, by name."""
    return np.array([_FINGER.search(name) is not None for name in skeleton.names])


def common_parameter(s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Eq. 10: h = t / T; s: t / T."""
    return s


def variable_speed_parameter(s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Eq. 11: speeds up over the first half and slows down over the second; s: t / T."""
    return np.where(s < 0.5, 2 * s**2, 1 - 2 * (s - 1) ** 2)


def interpolation_parameter(left: MotionClass, entered: MotionClass, s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Section 5.3.2: eq. 10 between two motions on the spot, eq. 11 for every other pair."""
    simple = left is entered is MotionClass.ON_THE_SPOT
    return common_parameter(s) if simple else variable_speed_parameter(s)


def interpolated(
    skeleton: Skeleton,
    before: NDArray[np.float64],
    left: NDArray[np.float64],
    entered: NDArray[np.float64],
    after: NDArray[np.float64],
    h: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Section 5.3.1: (N, J, 4) rotations between the frame left and the frame entered, both (J, 4).

    before: the frame before the one left; after: the frame after the one entered; h: (N,) from 0 to 1. Joints that
    turn pi/6 or more go by squad, others by slerp, fingers by lerp.
    """
    angle = np.linalg.norm(logarithm(multiply(inverse(left), entered)), axis=-1)
    fingers = finger_joints(skeleton)
    large = (angle >= LARGE_ANGLE) & ~fingers
    h = h[:, None]
    result = slerp(left, entered, h)
    result[:, fingers] = normalised_lerp(left[fingers], entered[fingers], h)
    result[:, large] = squad(before[large], left[large], entered[large], after[large], h)
    return result
