"""Feet that stand where the performer's stood, in scale: legs of other proportions are bent to reach.

The ball of a foot is to be where the performer's is, in scale, moved by how much the two stand apart in the bind pose;
that difference turns with the foot. A foot that stands still therefore stands still here too, without anything to be
remembered from frame to frame; one in the air goes where its leg takes it. The knee keeps the plane in which it bends,
the foot its direction.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

_STRETCH = 0.9995
"""How far a leg is stretched at most, of its length, that was not stretched so far: a straight knee snaps."""

_BENT = 0.08
"""Sine of the knee's angle from which on thigh and shank tell its axis."""

_STANDS, _FLIES = 0.03, 0.09
"""Height of a sole over the floor, in lengths of the leg, up to which a foot stands, captured floors being uneven, and
from which on it is wholly in the air."""

_MOST_DROP = 0.12
"""How far the hips come down at most, in lengths of the leg."""

_EPSILON = 1e-9


@dataclass(frozen=True, eq=False)
class Leg:
    """The joints of one leg, hip to ankle, and (3,) the knee's axis in the hip joint's frame."""

    upper: int
    lower: int
    foot: int
    knee_axis: NDArray[np.float64]


def make_leg(upper: int, lower: int, foot: int, turns: NDArray[np.float64]) -> Leg:
    """turns: (J, 3, 3) the joints' rotations in the bind pose, facing +Z: there knees bend about the lateral axis."""
    return Leg(upper, lower, foot, turns[upper].T @ np.array([1.0, 0.0, 0.0]))


def standing(leg: Leg, at: NDArray[np.float64], sole_height: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T,) 1 where a foot stands, 0 in the air; at: (T, J, 3) metres, sole_height: (T,) metres over the floor."""
    near = np.clip((_FLIES - sole_height / _length(leg, at)) / (_FLIES - _STANDS), 0, 1)
    return near * near * (3 - 2 * near)


def hips_drop(leg: Leg, at: NDArray[np.float64], goal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T,) metres the hips have to come down for a foot to reach its goal.

    at: (T, J, 3) metres; goal: (T, 3) metres, of the ankle.
    """
    hip, length = at[:, leg.upper], _length(leg, at)
    aside = np.linalg.norm((goal - hip)[:, [0, 2]], axis=1)
    reach = np.sqrt(np.maximum((_STRETCH * length) ** 2 - aside**2, 0))
    return np.clip(hip[:, 1] - goal[:, 1] - reach, 0, _MOST_DROP * length)


def reaching(
    leg: Leg, at: NDArray[np.float64], turns: NDArray[np.float64], goal: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(T, 3, 3) each: what to turn thigh and shank by in the world, so that the ankle comes to its goal (T, 3) metres.

    at: (T, J, 3) metres, turns: (T, J, 3, 3). A goal out of reach is come near to.
    """
    hip, knee, ankle = at[:, leg.upper], at[:, leg.lower], at[:, leg.foot]
    thigh, shank = knee - hip, ankle - knee
    upper, lower = np.linalg.norm(thigh, axis=1), np.linalg.norm(shank, axis=1)
    bent = np.cross(thigh, shank) / (upper * lower)[:, None]
    axis = _knee_axis(bent, turns[:, leg.upper] @ leg.knee_axis)
    longest = np.maximum(_STRETCH * (upper + lower), np.linalg.norm(ankle - hip, axis=1))
    distance = np.clip(np.linalg.norm(goal - hip, axis=1), np.abs(upper - lower) + 1e-4, longest)
    cosine = np.clip((distance**2 - upper**2 - lower**2) / (2 * upper * lower), -1, 1)
    angle = np.arctan2(np.linalg.norm(bent, axis=1), np.einsum("ti,ti->t", thigh, shank) / (upper * lower))
    knees = Rotation.from_rotvec((np.arccos(cosine) - angle)[:, None] * axis).as_matrix()
    swing = _smallest_arc(thigh + np.einsum("tij,tj->ti", knees, shank), goal - hip)
    return swing, swing @ knees


def _knee_axis(bent: NDArray[np.float64], straight: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, 3) unit: square to thigh and shank, `bent`, as long as the sine of the knee's angle; else `straight`."""
    sine = np.linalg.norm(bent, axis=1, keepdims=True)
    told = np.clip(sine / _BENT, 0, 1)
    told = told * told * (3 - 2 * told)
    return _unit(told * _unit(bent) + (1 - told) * straight)


def _length(leg: Leg, at: NDArray[np.float64]) -> NDArray[np.float64]:
    thigh, shank = at[:, leg.lower] - at[:, leg.upper], at[:, leg.foot] - at[:, leg.lower]
    return np.linalg.norm(thigh, axis=1) + np.linalg.norm(shank, axis=1)


def _smallest_arc(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, 3, 3) the smallest rotations that turn vectors (T, 3) to others."""
    start, end = _unit(start), _unit(end)
    axis, cosine = np.cross(start, end), np.einsum("ti,ti->t", start, end)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, cosine)
    return Rotation.from_rotvec(_unit(axis) * angle[:, None]).as_matrix()


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _EPSILON)
