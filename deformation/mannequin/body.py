"""The mannequin's shape: anatomical masses around the joints, after published circumferences and breadths.

Lengths in the tables are shares of stature. Girths follow ANSUR II (Gordon et al. 2014, "2012 Anthropometric Survey of
U.S. Army Personnel", NATICK/TR-15/007), medians between the sexes, taken a little athletic: neck 0.21, chest 0.55,
waist 0.47, hips 0.57, thigh 0.34, knee 0.215, calf 0.215, ankle 0.128, upper arm 0.185, forearm 0.16, wrist 0.097.
Heights follow Drillis and Contini (1966).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.mannequin.field import Field, Loft, ellipsoid, loft, smooth_cut, smooth_union
from deformation.mannequin.landmarks import Landmarks, Side

_UP = np.array([0.0, 1.0, 0.0])
_AHEAD = np.array([0.0, 0.0, 1.0])

# Station, then radii: outward, inward, front, back. Legs and arms: 0 is the first joint, 1 the middle, 2 the last.
_LEG = (
    (-0.10, 0.050, 0.046, 0.046, 0.050),
    (0.10, 0.054, 0.050, 0.053, 0.056),
    (0.30, 0.053, 0.048, 0.056, 0.053),
    (0.55, 0.047, 0.041, 0.052, 0.046),
    (0.78, 0.039, 0.034, 0.043, 0.037),
    (0.92, 0.035, 0.033, 0.0375, 0.0345),
    (1.00, 0.0335, 0.034, 0.0375, 0.0325),
    (1.10, 0.0315, 0.0315, 0.032, 0.035),
    (1.28, 0.034, 0.0335, 0.029, 0.0425),
    (1.45, 0.0315, 0.032, 0.027, 0.0405),
    (1.65, 0.0245, 0.025, 0.024, 0.030),
    (1.82, 0.0195, 0.020, 0.021, 0.0235),
    (1.92, 0.0185, 0.019, 0.0205, 0.0225),
    (2.00, 0.0205, 0.0205, 0.021, 0.024),
)
_ARM = (
    (-0.05, 0.030, 0.030, 0.032, 0.032),
    (0.20, 0.031, 0.030, 0.0325, 0.0325),
    (0.45, 0.0285, 0.029, 0.031, 0.031),
    (0.70, 0.0255, 0.026, 0.0285, 0.0275),
    (0.90, 0.0225, 0.0225, 0.026, 0.0245),
    (1.00, 0.0225, 0.0215, 0.026, 0.024),
    (1.15, 0.0245, 0.0235, 0.0275, 0.0235),
    (1.30, 0.0245, 0.0240, 0.027, 0.022),
    (1.55, 0.0205, 0.0205, 0.0225, 0.0195),
    (1.80, 0.0155, 0.0150, 0.0185, 0.0165),
    (1.95, 0.0130, 0.0125, 0.0170, 0.0155),
    (2.03, 0.0125, 0.0120, 0.0165, 0.0155),
)
"""Arms hang palm inward: outward is the back of the hand, front the thumb."""

_TORSO = (
    (0.470, 0.070, 0.046, 0.052),
    (0.490, 0.092, 0.056, 0.066),
    (0.520, 0.0985, 0.059, 0.069),
    (0.550, 0.0955, 0.059, 0.064),
    (0.585, 0.0865, 0.057, 0.054),
    (0.620, 0.0795, 0.054, 0.047),
    (0.650, 0.0800, 0.054, 0.047),
    (0.690, 0.0865, 0.058, 0.054),
    (0.730, 0.0930, 0.061, 0.062),
    (0.765, 0.0935, 0.058, 0.066),
    (0.795, 0.0850, 0.049, 0.063),
    (0.820, 0.0700, 0.037, 0.055),
    (0.840, 0.0500, 0.027, 0.044),
)
"""Height where hips are at 0.52 and shoulders at 0.818, then half breadth, depth before and behind the joints' plane."""

_FOOT = (
    (-0.030, 0.0165, 0.0165, 0.026),
    (-0.012, 0.0190, 0.0185, 0.038),
    (0.008, 0.0195, 0.0190, 0.046),
    (0.030, 0.0205, 0.0195, 0.038),
    (0.055, 0.0235, 0.0220, 0.0285),
    (0.078, 0.0265, 0.0255, 0.0205),
    (0.095, 0.0240, 0.0250, 0.0155),
    (0.106, 0.0185, 0.0220, 0.0125),
)
"""Ahead of the ankle, then radii outward, inward and upward from the sole."""

FINGERS = ((0.0165, 0.050, 0.0066), (0.0057, 0.056, 0.0068), (-0.0052, 0.052, 0.0065), (-0.0153, 0.041, 0.0057))
"""Towards the thumb, length, radius at the knuckle: index to little finger."""

_HIP_SHARE, _SHOULDER_SHARE = 0.520, 0.818


@dataclass(frozen=True, eq=False)
class Frame:
    """A limb's own axes. origin (3,) metres; along, outward, front: (3,) orthonormal; scale: metres of stature."""

    origin: NDArray[np.float64]
    along: NDArray[np.float64]
    outward: NDArray[np.float64]
    front: NDArray[np.float64]
    scale: float

    def point(self, along: float, outward: float = 0.0, front: float = 0.0) -> NDArray[np.float64]:
        """(3,) metres, from shares of stature."""
        return self.origin + self.scale * (along * self.along + outward * self.outward + front * self.front)

    def direction(self, along: float, outward: float = 0.0, front: float = 0.0) -> NDArray[np.float64]:
        """(3,) unit."""
        vector = along * self.along + outward * self.outward + front * self.front
        return vector / np.linalg.norm(vector)


def frame(origin: NDArray[np.float64], along: NDArray[np.float64], sign: float, scale: float) -> Frame:
    """The frame of a limb that runs `along` beside the body; front is +Z made square to it."""
    front = _AHEAD - (_AHEAD @ along) * along
    front = front / np.linalg.norm(front)
    outward = np.cross(along, front)
    return Frame(origin, along, outward if outward[0] * sign > 0 else -outward, front, scale)


def leg_frame(body: Landmarks, side: Side) -> Frame:
    """Origin at the hip joint."""
    return frame(side.hip, side.leg_direction, side.sign, body.stature)


def arm_frame(body: Landmarks, side: Side) -> Frame:
    """Origin at the shoulder joint."""
    return frame(side.shoulder, side.arm_direction, side.sign, body.stature)


def hand_frame(body: Landmarks, side: Side) -> Frame:
    """Origin at the wrist; outward is the back of the hand, front the thumb's side."""
    return frame(side.wrist, side.arm_direction, side.sign, body.stature)


def foot_frame(body: Landmarks, side: Side) -> Frame:
    """Origin on the floor below the ankle; along points to the toes, front up."""
    origin = side.ankle * [1, 0, 1]
    outward = np.cross(_UP, side.foot_direction)
    return Frame(origin, side.foot_direction, outward * side.sign, _UP, body.stature)


def torso_point(body: Landmarks, height: float, lateral: float = 0.0, front: float = 0.0) -> NDArray[np.float64]:
    """(3,) metres of a point in shares of stature: height as in the torso's table, then left and ahead of the plane
    through hip and shoulder joints."""
    hips, shoulders = (body.left.hip + body.right.hip) / 2, (body.left.shoulder + body.right.shoulder) / 2
    up = (height - _HIP_SHARE) / (_SHOULDER_SHARE - _HIP_SHARE)
    centre = hips + np.clip(up, -0.2, 1.1) * (shoulders - hips)
    centre[1] = hips[1] + up * (shoulders[1] - hips[1])
    return centre + body.stature * np.array([lateral, 0.0, front])


def breadth(body: Landmarks, height: float) -> float:
    """How wide this body is at a height of the torso against the tables: from its hips and shoulders."""
    hips = abs(body.left.hip[0] - body.right.hip[0]) / (2 * 0.052 * body.stature)
    shoulders = abs(body.left.shoulder[0] - body.right.shoulder[0]) / (2 * 0.118 * body.stature)
    low, high = np.clip(hips, 0.9, 1.15), np.clip(np.sqrt(shoulders), 0.78, 1.12)
    return float(np.interp(height, (0.58, 0.70), (low, high)))


def body_field(body: Landmarks, finger_blend: float = 0.0025) -> Field:
    """The whole body as one implicit surface. finger_blend: metres over which neighbouring fingers melt together."""
    torso, head = _torso(body), _head(body)
    sides = [(_leg(body, side), _arm(body, side), _hand(body, side, finger_blend)) for side in body.sides]
    unit = body.stature

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        trunk = smooth_union(torso(points), head(points), 0.030 * unit)
        legs = smooth_union(sides[0][0](points), sides[1][0](points), 0.006 * unit)
        arms = np.minimum(sides[0][1](points), sides[1][1](points))
        hands = np.minimum(sides[0][2](points), sides[1][2](points))
        value = smooth_union(trunk, legs, 0.034 * unit)
        value = smooth_union(value, arms, 0.040 * unit)
        return smooth_union(value, hands, 0.012 * unit)

    return field


def _limb(frame: Frame, stations: NDArray[np.float64], table: NDArray[np.float64], caps: tuple[float, float]) -> Loft:
    """A loft whose table gives outward, inward, front, back at stations in metres."""
    radii = table * frame.scale
    if np.cross(frame.along, frame.front) @ frame.outward < 0:
        radii = radii[:, [1, 0, 2, 3]]
    return loft(frame.origin, frame.along, frame.front, list(stations), radii.tolist(), caps)


def _stations(table: Sequence[Sequence[float]], first: float, second: float) -> NDArray[np.float64]:
    """Stations of 0, 1, 2 at the joints as metres from the first joint."""
    return np.interp(
        [row[0] for row in table], (-1, 0, 1, 2, 3), (-first, 0, first, first + second, first + 2 * second)
    )


def _leg(body: Landmarks, side: Side) -> Field:
    own = leg_frame(body, side)
    thigh, shank = (float(np.linalg.norm(b - a)) for a, b in ((side.hip, side.knee), (side.knee, side.ankle)))
    unit = body.stature
    table = np.array(_LEG)
    limb = _limb(own, _stations(_LEG, thigh, shank), table[:, 1:], (0.03 * unit, 0.02 * unit))
    foot = _foot(body, side)

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return smooth_union(limb(points), foot(points), 0.016 * unit)

    return field


def _foot(body: Landmarks, side: Side) -> Field:
    own = foot_frame(body, side)
    unit = body.stature
    table = np.array(_FOOT)
    rise = np.clip(side.ankle[1] / (0.043 * unit), 0.85, 1.9)
    tall = np.interp(table[:, 0], (0.0, 0.07), (rise, 1.0))
    radii = np.stack([table[:, 1], table[:, 2], table[:, 3] * tall, np.full(len(table), 0.02)], axis=1)
    shape = _limb(own, table[:, 0] * unit, radii, (0.010 * unit, 0.012 * unit))
    sole = 0.010 * unit

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return smooth_cut(shape(points), points[:, 1], sole)

    return field


def _arm(body: Landmarks, side: Side) -> Field:
    own = arm_frame(body, side)
    upper, lower = (float(np.linalg.norm(b - a)) for a, b in ((side.shoulder, side.elbow), (side.elbow, side.wrist)))
    unit = body.stature
    table = np.array(_ARM)
    limb = _limb(own, _stations(_ARM, upper, lower), table[:, 1:], (0.03 * unit, 0.01 * unit))
    deltoid = ellipsoid(own.point(0.022, 0.008, 0.0), [0.031 * unit, 0.050 * unit, 0.037 * unit], own.along, own.front)

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return smooth_union(limb(points), deltoid(points), 0.02 * unit)

    return field


def _hand(body: Landmarks, side: Side, finger_blend: float) -> Field:
    own = hand_frame(body, side)
    unit = body.stature
    palm = _palm(own)
    fingers = [_finger(own, *finger) for finger in FINGERS]
    thumb = _thumb(own)

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = fingers[0](points)
        for finger in fingers[1:]:
            value = smooth_union(value, finger(points), finger_blend)
        value = smooth_union(value, palm(points), 0.008 * unit)
        return smooth_union(value, thumb(points), 0.009 * unit)

    return field


def _palm(own: Frame) -> Field:
    table = np.array(
        [
            (-0.010, 0.0115, 0.0115, 0.0155, 0.0145),
            (0.010, 0.0110, 0.0120, 0.0180, 0.0165),
            (0.030, 0.0095, 0.0115, 0.0205, 0.0195),
            (0.050, 0.0080, 0.0090, 0.0215, 0.0200),
        ]
    )
    return _limb(own, table[:, 0] * own.scale, table[:, 1:], (0.01 * own.scale, 0.008 * own.scale))


def finger_path(own: Frame, across: float, length: float) -> list[NDArray[np.float64]]:
    """Knuckle, middle joint and tip (3,) metres of a finger, a little bent towards the palm and fanned out."""
    fan = across * 3.0
    knuckle = own.point(0.050 - abs(across - 0.004) * 0.25, 0.0005, across)
    middle = knuckle + own.scale * length * 0.48 * own.direction(1.0, -0.14, fan)
    return [knuckle, middle, middle + own.scale * length * 0.52 * own.direction(1.0, -0.42, fan * 0.8)]


def thumb_path(own: Frame) -> list[NDArray[np.float64]]:
    """Root, middle joint and tip (3,) metres of the thumb."""
    root = own.point(0.012, -0.006, 0.012)
    middle = root + own.scale * 0.034 * own.direction(0.74, -0.32, 0.62)
    return [root, middle, middle + own.scale * 0.028 * own.direction(0.90, -0.22, 0.36)]


def _finger(own: Frame, across: float, length: float, radius: float) -> Field:
    return _chain(finger_path(own, across, length), [radius, radius * 0.93, radius * 0.72], own)


def _thumb(own: Frame) -> Field:
    return _chain(thumb_path(own), [0.0120, 0.0082, 0.0062], own)


def _chain(path: list[NDArray[np.float64]], radii: list[float], own: Frame) -> Field:
    """Round tapering links through points (3,) metres, with radii in shares of stature."""
    links = []
    for start, end, first, last in zip(path, path[1:], radii, radii[1:], strict=False):
        length = float(np.linalg.norm(end - start))
        sections = [[first * own.scale] * 4, [last * own.scale] * 4]
        links.append(
            loft(start, end - start, own.outward, [0, length], sections, (first * own.scale, last * own.scale))
        )

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = links[0](points)
        for link in links[1:]:
            value = smooth_union(value, link(points), 0.004 * own.scale)
        return value

    return field


def _torso(body: Landmarks) -> Field:
    unit = body.stature
    hull = _torso_hull(body)
    masses = [(_paired(body, height, x, z, radii), blend * unit) for height, x, z, radii, blend in _MASSES]
    slopes = [_trapezius(body, side) for side in body.sides]

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = hull(points)
        for (left, right), blend in masses:
            value = smooth_union(value, smooth_union(left(points), right(points), 0.01 * unit), blend)
        return smooth_union(value, smooth_union(slopes[0](points), slopes[1](points), 0.02 * unit), 0.03 * unit)

    return field


_MASSES = (
    (0.497, 0.046, -0.036, (0.048, 0.046, 0.046), 0.030),
    (0.748, 0.046, 0.034, (0.047, 0.034, 0.030), 0.026),
    (0.760, 0.050, -0.048, (0.042, 0.048, 0.024), 0.030),
    (0.700, 0.066, -0.022, (0.032, 0.075, 0.040), 0.030),
)
"""Buttocks, chest, shoulder blades, flanks: height, lateral, ahead, radii (side, up, ahead), blend."""


def _torso_hull(body: Landmarks) -> Loft:
    unit = body.stature
    low = torso_point(body, _TORSO[0][0])
    high = torso_point(body, _TORSO[-1][0])
    axis = (high - low) / np.linalg.norm(high - low)
    stations = [float((torso_point(body, row[0]) - low) @ axis) for row in _TORSO]
    radii = [
        [x * unit * breadth(body, y), x * unit * breadth(body, y), front * unit, back * unit]
        for y, x, front, back in _TORSO
    ]
    return loft(low, axis, _AHEAD, stations, radii, (0.02 * unit, 0.02 * unit), 2.25)


def _paired(
    body: Landmarks, height: float, lateral: float, front: float, radii: Sequence[float]
) -> tuple[Field, Field]:
    wide = breadth(body, height)
    size = [radii[0] * body.stature * wide, radii[1] * body.stature, radii[2] * body.stature]
    left, right = (ellipsoid(torso_point(body, height, sign * lateral * wide, front), size) for sign in (1.0, -1.0))
    return left, right


def _trapezius(body: Landmarks, side: Side) -> Field:
    unit = body.stature
    start = torso_point(body, 0.868, side.sign * 0.012, -0.016)
    end = side.shoulder + unit * np.array([-side.sign * 0.018, 0.010, -0.004])
    length = float(np.linalg.norm(end - start))
    sections = [[0.026 * unit] * 4, [0.024 * unit] * 4, [0.020 * unit] * 4]
    return loft(start, end - start, _AHEAD, [0, length / 2, length], sections, (0.02 * unit, 0.02 * unit))


def _head(body: Landmarks) -> Field:
    unit = body.stature
    at = Frame(body.head, _UP, np.array([1.0, 0.0, 0.0]), _AHEAD, unit)
    root = torso_point(body, 0.815, 0.0, -0.014)
    top = at.point(0.012, 0.0, -0.006)
    length = float(np.linalg.norm(top - root))
    neck = loft(
        root,
        top - root,
        _AHEAD,
        [0, 0.35 * length, 0.7 * length, length],
        [
            [r * unit, r * unit, f * unit, f * unit]
            for r, f in ((0.042, 0.036), (0.035, 0.034), (0.0325, 0.034), (0.033, 0.036))
        ],
        (0.01 * unit, 0.01 * unit),
    )
    cranium = ellipsoid(at.point(0.050, 0.0, -0.004), [0.0435 * unit, 0.049 * unit, 0.055 * unit])
    jaw = loft(
        at.point(-0.030, 0.0, 0.028),
        at.direction(1.0, 0.0, -0.12),
        at.direction(0.0, 0.0, 1.0),
        [0, 0.015 * unit, 0.035 * unit, 0.060 * unit, 0.085 * unit],
        [
            [x * unit, x * unit, f * unit, b * unit]
            for x, f, b in (
                (0.016, 0.0165, 0.014),
                (0.0235, 0.0205, 0.030),
                (0.0300, 0.0220, 0.042),
                (0.0365, 0.0260, 0.045),
                (0.0360, 0.0280, 0.045),
            )
        ],
        (0.006 * unit, 0.02 * unit),
        2.3,
    )
    nose = loft(
        at.point(0.006, 0.0, 0.0515),
        at.direction(1.0, 0.0, -0.30),
        _AHEAD,
        [0, 0.010 * unit, 0.034 * unit],
        [
            [0.0085 * unit, 0.0085 * unit, 0.0125 * unit, 0.010 * unit],
            [0.0070 * unit, 0.0070 * unit, 0.011 * unit, 0.010 * unit],
            [0.0045 * unit, 0.0045 * unit, 0.005 * unit, 0.010 * unit],
        ],
        (0.005 * unit, 0.008 * unit),
    )
    brow = ellipsoid(at.point(0.047, 0.0, 0.036), [0.032 * unit, 0.008 * unit, 0.0155 * unit])
    sockets = [
        ellipsoid(at.point(0.034, s * 0.0165, 0.0585), [0.0125 * unit, 0.008 * unit, 0.011 * unit]) for s in (1, -1)
    ]

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = smooth_union(cranium(points), jaw(points), 0.016 * unit)
        value = smooth_union(value, brow(points), 0.012 * unit)
        value = smooth_cut(value, np.minimum(sockets[0](points), sockets[1](points)), 0.012 * unit)
        value = smooth_union(value, nose(points), 0.008 * unit)
        return smooth_union(value, neck(points), 0.014 * unit)

    return field
