"""Where a skeleton's joints are in the bind pose, in the terms in which the mannequin is shaped."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.errors import SixpointError
from reconstruction.skeleton import Skeleton

_SHOULDER_SHARE = 0.818
"""Height of the shoulder joint as a share of stature (Drillis and Contini 1966, in Winter)."""


_SKULL_SHARE = 0.898
"""Least height of the skull's base as a share of stature: some skeletons call a joint low in the neck the head."""


@dataclass(frozen=True, eq=False)
class Side:
    """One side of the body. sign: +1 left, -1 right. Points (3,) metres; directions (3,) unit."""

    sign: float
    shoulder: NDArray[np.float64]
    elbow: NDArray[np.float64]
    wrist: NDArray[np.float64]
    hip: NDArray[np.float64]
    knee: NDArray[np.float64]
    ankle: NDArray[np.float64]
    foot_direction: NDArray[np.float64]

    @property
    def arm_direction(self) -> NDArray[np.float64]:
        """(3,) from shoulder to wrist."""
        return _unit(self.wrist - self.shoulder)

    @property
    def leg_direction(self) -> NDArray[np.float64]:
        """(3,) from hip to ankle."""
        return _unit(self.ankle - self.hip)


@dataclass(frozen=True, eq=False)
class Landmarks:
    """The joints that shape the body. stature: metres, from the height of the shoulders over the floor."""

    stature: float
    left: Side
    right: Side
    neck: NDArray[np.float64]
    head: NDArray[np.float64]

    @property
    def sides(self) -> tuple[Side, Side]:
        """Left, then right."""
        return self.left, self.right


def landmarks(skeleton: Skeleton, positions: NDArray[np.float64]) -> Landmarks:
    """From joint positions (J, 3) metres in the bind pose, floor at y = 0.

    Raises SixpointError naming the bones without which there is no body; toes, neck and head may be missing.
    """
    bones = skeleton.humanoid
    needed = [f"{s}_{b}" for s in ("left", "right") for b in _LIMB_JOINTS]
    missing = [bone for bone in needed if bone not in bones]
    if missing:
        raise SixpointError(f"a mannequin needs {', '.join(missing)}: the skeleton has {', '.join(skeleton.names)}")
    left, right = (_side(name, bones, positions) for name in ("left", "right"))
    between = (left.shoulder + right.shoulder) / 2
    stature = float(between[1]) / _SHOULDER_SHARE
    neck = positions[bones["neck"]] if "neck" in bones else between + stature * np.array([0, 0.035, 0])
    head = positions[bones["head"]].copy() if "head" in bones else neck + stature * np.array([0, 0.05, 0.01])
    head[1] = max(head[1], _SKULL_SHARE * stature)
    return Landmarks(stature, left, right, neck, head)


_LIMB_JOINTS = {
    "upper_arm": "shoulder",
    "lower_arm": "elbow",
    "hand": "wrist",
    "upper_leg": "hip",
    "lower_leg": "knee",
    "foot": "ankle",
}


def _side(name: str, bones: dict[str, int], positions: NDArray[np.float64]) -> Side:
    points = {point: positions[bones[f"{name}_{bone}"]] for bone, point in _LIMB_JOINTS.items()}
    ahead = np.array([0.0, 0.0, 1.0])
    if f"{name}_toes" in bones:
        ahead = (positions[bones[f"{name}_toes"]] - points["ankle"]) * [1, 0, 1]
    return Side(1.0 if name == "left" else -1.0, **points, foot_direction=_unit(ahead))


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector / max(float(np.linalg.norm(vector)), 1e-12)
