"""The mannequin's shape: anatomical masses around the joints, after published circumferences and breadths.

Lengths in the tables are shares of stature. Heights follow Drillis and Contini (1966). Girths are set by eye near those
of adults in ANSUR II (Gordon et al. 2014, "2012 Anthropometric Survey of U.S. Army Personnel", NATICK/TR-15/007), on
the lean side at the waist; measured on the finished standard body they are: chest 0.60, waist 0.44, hips 0.60, knee
0.22, calf 0.22, ankle 0.13, upper arm 0.19, forearm 0.16, wrist 0.10 of stature.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.mannequin.field import Field, Loft, ellipsoid, loft, near, smooth_cut, smooth_union
from deformation.mannequin.landmarks import Landmarks, Side

_UP = np.array([0.0, 1.0, 0.0])
_AHEAD = np.array([0.0, 0.0, 1.0])

# Station, then radii: outward, inward, front, back. Legs and arms: 0 is the first joint, 1 the middle, 2 the last.
_LEG = (
    (-0.30, 0.026, 0.030, 0.034, 0.034),
    (-0.08, 0.0420, 0.0420, 0.046, 0.047),
    (0.10, 0.0505, 0.0480, 0.052, 0.053),
    (0.30, 0.0525, 0.0475, 0.0555, 0.052),
    (0.55, 0.047, 0.041, 0.052, 0.046),
    (0.78, 0.039, 0.034, 0.043, 0.037),
    (0.92, 0.035, 0.033, 0.0375, 0.0345),
    (1.00, 0.0335, 0.034, 0.0375, 0.0325),
    (1.10, 0.0315, 0.0315, 0.0335, 0.035),
    (1.28, 0.034, 0.0335, 0.029, 0.0425),
    (1.45, 0.0315, 0.032, 0.027, 0.0405),
    (1.65, 0.0245, 0.025, 0.024, 0.030),
    (1.82, 0.0195, 0.020, 0.021, 0.0235),
    (1.92, 0.0185, 0.019, 0.0205, 0.0225),
    (2.00, 0.0205, 0.0205, 0.021, 0.024),
)
_THIGHS_APART = 0.85
"""Share of the way to the other leg that a thigh may fill, for skeletons with narrow hips."""

_ARM = (
    (-0.05, 0.0235, 0.030, 0.031, 0.031),
    (0.20, 0.0285, 0.029, 0.0320, 0.0320),
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
    (0.466, 0.024, 0.026, 0.038),
    (0.478, 0.052, 0.042, 0.052),
    (0.495, 0.077, 0.0545, 0.062),
    (0.520, 0.0920, 0.0580, 0.066),
    (0.550, 0.0930, 0.0580, 0.062),
    (0.585, 0.0885, 0.0560, 0.054),
    (0.620, 0.0830, 0.0535, 0.048),
    (0.650, 0.0835, 0.0540, 0.047),
    (0.690, 0.0870, 0.0565, 0.051),
    (0.730, 0.0890, 0.0585, 0.056),
    (0.765, 0.0880, 0.0550, 0.058),
    (0.795, 0.0770, 0.0450, 0.053),
    (0.820, 0.0600, 0.0330, 0.046),
    (0.840, 0.0420, 0.0260, 0.037),
)
"""Height where hips are at 0.52 and shoulders at 0.818; half breadth; depth before and behind the joints' plane."""

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

FINGERS = ((0.0172, 0.050, 0.0055), (0.0058, 0.056, 0.0057), (-0.0054, 0.052, 0.0054), (-0.0164, 0.041, 0.0047))
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
    centre[1] = hips[1] + (up * (shoulders[1] - hips[1]) if up > 0 else (height - _HIP_SHARE) * body.stature)
    return centre + body.stature * np.array([lateral, 0.0, front])


def breadth(body: Landmarks, height: float) -> float:
    """How wide this body is at a height of the torso against the tables: from its hips and shoulders."""
    hips = abs(body.left.hip[0] - body.right.hip[0]) / (2 * 0.052 * body.stature)
    shoulders = abs(body.left.shoulder[0] - body.right.shoulder[0]) / (2 * 0.118 * body.stature)
    low, high = np.clip(hips, 0.9, 1.15), np.clip(np.sqrt(shoulders), 0.78, 1.12)
    return float(np.interp(height, (0.58, 0.70), (low, high)))


def body_field(body: Landmarks, finger_blend: float = 0.003) -> Field:
    """The whole body as one implicit surface. finger_blend: share of stature over which fingers melt together."""
    torso, head = _torso(body), _head(body)
    sides = [(_leg(body, side), _arm(body, side), _hand(body, side, finger_blend)) for side in body.sides]
    unit = body.stature

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        trunk = smooth_union(torso(points), head(points), 0.030 * unit)
        legs = smooth_union(sides[0][0](points), sides[1][0](points), 0.004 * unit)
        arms = np.minimum(sides[0][1](points), sides[1][1](points))
        hands = np.minimum(sides[0][2](points), sides[1][2](points))
        value = smooth_union(trunk, legs, 0.060 * unit)
        value = smooth_union(value, arms, 0.034 * unit)
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
    table, stations = np.array(_LEG), _stations(_LEG, thigh, shank)
    to_midplane = np.abs(own.origin[0] + stations * own.along[0])
    table[:, 2] = np.minimum(table[:, 2], _THIGHS_APART * to_midplane / unit)
    limb = _limb(own, stations, table[:, 1:], (0.05 * unit, 0.02 * unit))
    foot = _foot(body, side)

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return smooth_union(limb(points), foot(points), 0.016 * unit)

    return near(field, (side.hip + side.ankle) / 2, float(np.linalg.norm(side.hip - side.ankle)) / 2 + 0.15 * unit)


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
    deltoid = ellipsoid(
        own.point(0.030, 0.004, 0.0), [0.0285 * unit, 0.046 * unit, 0.0345 * unit], own.along, own.front
    )

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return smooth_union(limb(points), deltoid(points), 0.02 * unit)

    return near(field, (side.shoulder + side.wrist) / 2, (upper + lower) / 2 + 0.06 * unit)


def _hand(body: Landmarks, side: Side, finger_blend: float) -> Field:
    own = hand_frame(body, side)
    unit = body.stature
    palm = _palm(own)
    fingers = [_finger(own, *finger) for finger in FINGERS]
    thumb = _thumb(own)

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = fingers[0](points)
        for finger in fingers[1:]:
            value = smooth_union(value, finger(points), finger_blend * unit)
        value = smooth_union(value, palm(points), 0.008 * unit)
        return smooth_union(value, thumb(points), 0.013 * unit)

    return near(field, own.point(0.05), 0.08 * unit)


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


def knuckle_bow(across: float) -> float:
    """How much nearer to the wrist than the middle finger's a knuckle is, in shares of stature."""
    return 0.25 * abs(across - 0.004)


def finger_path(own: Frame, across: float, length: float) -> list[NDArray[np.float64]]:
    """Knuckle, middle joint and tip (3,) metres of a finger, a little bent towards the palm and fanned out."""
    fan = across * 3.0
    knuckle = own.point(0.050 - knuckle_bow(across), 0.0005, across)
    middle = knuckle + own.scale * length * 0.48 * own.direction(1.0, -0.14, fan)
    return [knuckle, middle, middle + own.scale * length * 0.52 * own.direction(1.0, -0.42, fan * 0.8)]


def thumb_path(own: Frame) -> list[NDArray[np.float64]]:
    """Root, middle joint and tip (3,) metres of the thumb."""
    root = own.point(0.012, -0.006, 0.012)
    middle = root + own.scale * 0.034 * own.direction(0.72, -0.30, 0.68)
    return [root, middle, middle + own.scale * 0.028 * own.direction(0.90, -0.22, 0.36)]


def _finger(own: Frame, across: float, length: float, radius: float) -> Field:
    return _chain(finger_path(own, across, length), [radius, radius * 0.93, radius * 0.72], own)


def _thumb(own: Frame) -> Field:
    return _chain(thumb_path(own), [0.0108, 0.0076, 0.0058], own)


def _chain(path: list[NDArray[np.float64]], radii: list[float], own: Frame) -> Field:
    """Round tapering links through points (3,) metres, with radii in shares of stature."""
    sizes = np.array(radii) * own.scale
    links = [_link(path[n : n + 2], sizes[n : n + 2], own.outward) for n in range(len(path) - 1)]

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = links[0](points)
        for link in links[1:]:
            value = smooth_union(value, link(points), 0.004 * own.scale)
        return value

    return field


def _torso(body: Landmarks) -> Field:
    unit = body.stature
    hull = _torso_hull(body)
    masses = [(_paired(body, height, x, z, radii), blend * unit) for height, x, z, radii, blend in _TORSO_MASSES]
    straps = [(_strap(body, *strap), blend * unit) for *strap, blend in _STRAPS]

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = hull(points)
        for (left, right), blend in masses + straps:
            value = smooth_union(value, smooth_union(left(points), right(points), 0.02 * unit), blend)
        return value

    return field


_TORSO_MASSES = (
    (0.497, 0.043, -0.032, (0.046, 0.045, 0.046), 0.050),
    (0.755, 0.042, 0.026, (0.046, 0.034, 0.031), 0.050),
    (0.765, 0.048, -0.038, (0.040, 0.050, 0.023), 0.055),
)
"""Buttocks, chest, shoulder blades: height, lateral, ahead, radii (side, up, ahead), blend."""

_STRAPS = (
    ((0.862, 0.014, -0.016), (-0.010, -0.006, -0.004), (0.021, 0.021, 0.018), 0.045),
    ((0.765, 0.050, 0.026), (0.036, 0.000, 0.006), (0.020, 0.021, 0.016), 0.050),
    ((0.715, 0.060, -0.022), (0.026, -0.006, -0.010), (0.016, 0.018, 0.014), 0.045),
    ((0.826, 0.014, 0.014), (0.000, 0.014, 0.010), (0.009, 0.009, 0.011), 0.040),
)
"""Trapezius, pectoral, latissimus, collar bone: start (height, lateral, ahead), end in the arm's axes (along, outward,
front of the shoulder joint), radii from start to end, blend."""


def _strap(
    body: Landmarks, start: tuple[float, float, float], end: tuple[float, float, float], radii: Sequence[float]
) -> tuple[Loft, Loft]:
    """A muscle from the torso to the shoulder, left and right."""
    height, lateral, front = start
    left, right = (
        _link(
            [
                torso_point(body, height, side.sign * lateral * breadth(body, height), front),
                arm_frame(body, side).point(*end),
            ],
            np.array(radii) * body.stature,
            _AHEAD,
        )
        for side in body.sides
    )
    return left, right


def _link(ends: Sequence[NDArray[np.float64]], radii: NDArray[np.float64], front: NDArray[np.float64]) -> Loft:
    """A round limb between two points (3,) metres; radii (S,) metres at even steps."""
    axis = ends[1] - ends[0]
    stations = np.linspace(0, np.linalg.norm(axis), len(radii))
    return loft(
        ends[0], axis, front, stations.tolist(), np.repeat(radii[:, None], 4, 1).tolist(), (radii[0], radii[-1])
    )


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
    return loft(low, axis, _AHEAD, stations, radii, (0.010 * unit, 0.02 * unit), 2.25)


def _paired(body: Landmarks, height: float, lateral: float, front: float, radii: Sequence[float]) -> tuple[Loft, Loft]:
    wide = breadth(body, height)
    size = [radii[0] * body.stature * wide, radii[1] * body.stature, radii[2] * body.stature]
    left, right = (ellipsoid(torso_point(body, height, sign * lateral * wide, front), size) for sign in (1.0, -1.0))
    return left, right


_JAW = (
    (0.000, 0.0150, 0.0150, 0.012),
    (0.014, 0.0240, 0.0200, 0.030),
    (0.034, 0.0315, 0.0225, 0.044),
    (0.060, 0.0370, 0.0265, 0.048),
    (0.085, 0.0365, 0.0270, 0.048),
)
"""Up from the chin; half breadth; depth before and behind."""

_NECK = ((0.00, 0.042, 0.036), (0.35, 0.0340, 0.0335), (0.70, 0.0318, 0.0330), (1.00, 0.0325, 0.0350))
"""Share of the way from chest to skull; half breadth; half depth."""

_FACE = (
    (0.046, 0.000, 0.0360, (0.0290, 0.0080, 0.0140), 0.018),
    (0.018, 0.022, 0.0310, (0.0120, 0.0110, 0.0120), 0.018),
    (-0.0080, 0.000, 0.0375, (0.0140, 0.0090, 0.0105), 0.016),
    (-0.0300, 0.000, 0.0350, (0.0115, 0.0085, 0.0115), 0.014),
    (0.020, 0.0412, -0.0060, (0.0070, 0.0165, 0.0105), 0.012),
)
"""Brow, cheek bones, mouth, chin, ears: above the head joint, lateral, ahead, radii (side, up, ahead), blend."""

_EYE_SOCKET = (0.0340, 0.0165, 0.0600, (0.0125, 0.0080, 0.0105), 0.018)

_NOSE = (
    (0.0000, 0.0085, 0.0190),
    (0.0050, 0.0095, 0.0245),
    (0.0120, 0.0085, 0.0232),
    (0.0240, 0.0062, 0.0172),
    (0.0380, 0.0058, 0.0118),
)
"""Up from its base, 0.4 % of stature above the head joint; half breadth; depth before a line inside the face."""


def _head(body: Landmarks) -> Field:
    unit = body.stature
    at = Frame(body.head, _UP, np.array([1.0, 0.0, 0.0]), _AHEAD, unit)
    cranium = ellipsoid(at.point(0.050, 0.0, -0.004), [0.0430 * unit, 0.049 * unit, 0.0550 * unit])
    jaw, neck = _jaw(at), _neck(body, at)
    features = [
        ([ellipsoid(at.point(y, s * x, z), [r * unit for r in radii]) for s in ((1, -1) if x else (1,))], blend * unit)
        for y, x, z, radii, blend in (*_FACE, _EYE_SOCKET)
    ]
    sockets, socket_blend = features.pop()
    nose = _nose(at)

    def field(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = smooth_union(cranium(points), jaw(points), 0.020 * unit)
        for shapes, blend in features:
            value = smooth_union(value, _closest(shapes, points), blend)
        value = smooth_cut(value, _closest(sockets, points), socket_blend)
        return smooth_union(value, nose(points), 0.010 * unit)

    skull = near(field, at.point(0.035), 0.09 * unit)
    return lambda points: smooth_union(skull(points), neck(points), 0.022 * unit)


def _closest(shapes: Sequence[Field], points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.min([shape(points) for shape in shapes], axis=0)


def _jaw(at: Frame) -> Loft:
    sections = [[x * at.scale, x * at.scale, front * at.scale, back * at.scale] for _, x, front, back in _JAW]
    stations = [row[0] * at.scale for row in _JAW]
    caps = (0.006 * at.scale, 0.02 * at.scale)
    return loft(at.point(-0.030, 0.0, 0.027), at.direction(1.0, 0.0, -0.10), _AHEAD, stations, sections, caps, 2.15)


def _nose(at: Frame) -> Loft:
    sections = [[x * at.scale, x * at.scale, front * at.scale, 0.012 * at.scale] for _, x, front in _NOSE]
    stations = [row[0] * at.scale for row in _NOSE]
    return loft(at.point(0.004, 0.0, 0.041), _UP, _AHEAD, stations, sections, (0.004 * at.scale, 0.01 * at.scale))


def _neck(body: Landmarks, at: Frame) -> Loft:
    root, top = torso_point(body, 0.815, 0.0, -0.014), at.point(0.012, 0.0, -0.006)
    length = float(np.linalg.norm(top - root))
    sections = [[x * at.scale, x * at.scale, z * at.scale, z * at.scale] for _, x, z in _NECK]
    stations = [share * length for share, _, _ in _NECK]
    return loft(root, top - root, _AHEAD, stations, sections, (0.01 * at.scale, 0.01 * at.scale))
