"""The mannequin's quads: a figure of hexahedral blocks whose outer faces are divided evenly.

Blocks share corners where they are joined and have corners of their own where they only touch (between the legs,
between fingers), so the outside of the figure is one closed surface without handles. Each direction of each block names
how often it is divided, so that neighbours always match.
"""

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from deformation.mannequin.body import (
    FINGERS,
    arm_frame,
    finger_path,
    foot_frame,
    hand_frame,
    knuckle_bow,
    leg_frame,
    thumb_path,
    torso_point,
)
from deformation.mannequin.landmarks import Landmarks, Side

Corner = Hashable
COLUMNS, DEPTHS = 4, 4
"""Blocks across the torso's front and along its side."""

_TORSO_LEVELS = 8
_LEG_LEVELS = 7
_ARM_LEVELS = 7
_ARM_ROW = 3
"""The torso's level at whose sides the arms begin."""
_THUMB_LEVEL = 5
_FINGER_LEVELS = 2


@dataclass(frozen=True)
class Block:
    """A hexahedron. corners: 8, number 4 a + 2 b + c at (a, b, c) in {0, 1}^3; divisions: a name a direction."""

    part: str
    corners: tuple[Corner, ...]
    divisions: tuple[str, str, str]


@dataclass(frozen=True)
class Face:
    """An outer face, corners in order around it. divisions: of the first and of the second side."""

    part: str
    corners: tuple[Corner, Corner, Corner, Corner]
    divisions: tuple[str, str]


def blocks() -> Iterator[Block]:
    """Every block of the figure."""
    for i, j, k in product(range(-2, 2), range(DEPTHS), range(_TORSO_LEVELS)):
        part = "head" if k >= 5 else "torso"
        yield _block(part, lambda a, b, c: ("torso", a, b, c), (i, j, k), ("column", "depth", f"torso {k}"))
    for side in (1, -1):
        yield from _leg_blocks(side)
        yield from _arm_blocks(side)


def _leg_blocks(side: int) -> Iterator[Block]:
    columns = (0, 1) if side > 0 else (-2, -1)
    for i, j, m in product(columns, range(DEPTHS), range(_LEG_LEVELS)):
        part = "foot" if m >= 5 else "leg"
        yield _block(part, lambda a, b, c: _leg_corner(side, a, b, c), (i, j, m), ("column", "depth", f"leg {m}"))
    for i, r, f in product(columns, range(2), range(2)):
        name = ("column", f"leg {_LEG_LEVELS - 2 + r}", f"foot {f}")
        yield _block("foot", lambda a, b, c: _forefoot_corner(side, a, b, c), (i, r, f), name)


def _leg_corner(side: int, i: int, j: int, m: int) -> Corner:
    return ("torso", i, j, 0) if m == 0 else ("leg", side, i, j, m)


def _forefoot_corner(side: int, i: int, r: int, f: int) -> Corner:
    return _leg_corner(side, i, DEPTHS, _LEG_LEVELS - 2 + r) if f == 0 else ("forefoot", side, i, r, f)


def _arm_blocks(side: int) -> Iterator[Block]:
    band = f"torso {_ARM_ROW}"
    for j, a in product(range(DEPTHS), range(_ARM_LEVELS)):
        part = "hand" if a >= 4 else "arm"
        yield _block(part, lambda u, v, w: _arm_corner(side, u, v, w), (j, 0, a), ("depth", band, f"arm {a}"))
    for j, b in product(range(DEPTHS), range(_FINGER_LEVELS)):
        name = ("depth", band, f"finger {b}")
        yield _block("finger", lambda u, v, w, j=j: _finger_corner(side, j, u - j, v, w), (j, 0, b), name)
    for b in range(2):
        name = (f"arm {_THUMB_LEVEL}", band, f"thumb {b}")
        yield _block("finger", lambda u, v, w: _thumb_corner(side, u, v, w), (0, 0, b), name)


def _arm_corner(side: int, j: int, r: int, a: int) -> Corner:
    return ("torso", 2 * side, j, _ARM_ROW + r) if a == 0 else ("arm", side, j, r, a)


def _finger_corner(side: int, finger: int, u: int, r: int, b: int) -> Corner:
    return _arm_corner(side, finger + u, r, _ARM_LEVELS) if b == 0 else ("finger", side, finger, u, r, b)


def _thumb_corner(side: int, u: int, r: int, b: int) -> Corner:
    return _arm_corner(side, DEPTHS, r, _THUMB_LEVEL + u) if b == 0 else ("thumb", side, u, r, b)


def _block(
    part: str, corner: Callable[[int, int, int], Corner], at: tuple[int, int, int], divisions: tuple[str, str, str]
) -> Block:
    corners = tuple(corner(at[0] + a, at[1] + b, at[2] + c) for a, b, c in product((0, 1), repeat=3))
    return Block(part, corners, divisions)


_SIDES = (
    ((0, 1, 3, 2), (2, 1)),
    ((4, 6, 7, 5), (1, 2)),
    ((0, 4, 5, 1), (0, 2)),
    ((2, 3, 7, 6), (2, 0)),
    ((0, 2, 6, 4), (1, 0)),
    ((1, 5, 7, 3), (0, 1)),
)
"""Corners of a block's six faces, outward for a right-handed block, and the directions of their first two sides."""


def outer_faces(positions: dict[Corner, NDArray[np.float64]]) -> list[Face]:
    """The faces that only one block has, turned outward for corner positions (3,) metres."""
    seen: dict[frozenset[Corner], Face | None] = {}
    for block in blocks():
        mirrored = _handedness(block, positions) < 0
        for order, directions in _SIDES:
            a, b, c, d = (block.corners[n] for n in order)
            first, second = (block.divisions[n] for n in directions)
            face = Face(block.part, (a, b, c, d), (first, second))
            if mirrored:
                face = Face(block.part, (a, d, c, b), (second, first))
            key = frozenset(face.corners)
            seen[key] = None if key in seen else face
    return [face for face in seen.values() if face is not None]


def _handedness(block: Block, positions: dict[Corner, NDArray[np.float64]]) -> float:
    at = np.array([positions[corner] for corner in block.corners]).reshape(2, 2, 2, 3)
    edges = [at[1].mean((0, 1)) - at[0].mean((0, 1)), at[:, 1].mean((0, 1)) - at[:, 0].mean((0, 1))]
    return float(np.linalg.det([*edges, at[:, :, 1].mean((0, 1)) - at[:, :, 0].mean((0, 1))]))


def corner_positions(body: Landmarks) -> dict[Corner, NDArray[np.float64]]:
    """Where each corner of the figure starts, (3,) metres, near the body's surface."""
    positions: dict[Corner, NDArray[np.float64]] = {}
    for i, j, k in product(range(-2, 3), range(DEPTHS + 1), range(_TORSO_LEVELS + 1)):
        positions["torso", i, j, k] = _torso_corner_position(body, i, j, k)
    for side in body.sides:
        positions |= _leg_positions(body, side)
        positions |= _arm_positions(body, side)
    return positions


_TORSO_RINGS = (
    (0.452, 0.095, 0.050, 0.062),
    (0.565, 0.092, 0.058, 0.060),
    (0.625, 0.080, 0.054, 0.048),
    (0.745, 0.100, 0.062, 0.064),
    (0.838, 0.100, 0.034, 0.052),
    (0.866, 0.036, 0.030, 0.040),
)
"""Height, half breadth, front, back: crotch, hips, waist, armpits, shoulders, root of the neck."""

_HEAD_RINGS = ((-0.030, 0.028, 0.050, 0.038), (0.045, 0.042, 0.054, 0.058), (0.092, 0.024, 0.030, 0.034))
"""Above the head joint, then the same: jaw, brow, crown."""


def _disc(u: float, v: float) -> tuple[float, float]:
    """A square's point as one of the unit disc (the elliptical mapping)."""
    return u * np.sqrt(1 - v * v / 2), v * np.sqrt(1 - u * u / 2)


def _torso_corner_position(body: Landmarks, i: int, j: int, k: int) -> NDArray[np.float64]:
    x, z = _disc(i / 2, (j - 2) / 2)
    head = k - len(_TORSO_RINGS)
    if head >= 0:
        height, wide, front, back = _HEAD_RINGS[head]
        dome = 0.012 * (1 - x * x - z * z) if k == _TORSO_LEVELS else 0.0
        jut = -0.008 * z if head == 0 else 0.0
        return body.head + body.stature * np.array([x * wide, height + dome + jut, z * (front if z > 0 else back)])
    height, wide, front, back = _TORSO_RINGS[k]
    if k == 0:
        height += 0.075 * x * x
    return torso_point(body, height, x * wide, z * (front if z > 0 else back))


_LEG_RINGS = ((0.25, 0.05), (0.88, 0.036), (1.12, 0.034), (1.35, 0.034), (1.93, 0.020))
"""Station between the joints and radius."""

_HEEL_RINGS = ((0.022, 0.019), (0.000, 0.017))
"""Height over the floor and half breadth of the heel's block."""


def _leg_positions(body: Landmarks, side: Side) -> dict[Corner, NDArray[np.float64]]:
    positions: dict[Corner, NDArray[np.float64]] = {}
    leg, foot, sign = leg_frame(body, side), foot_frame(body, side), int(side.sign)
    joints = np.array([side.hip, side.knee, side.ankle])
    for i, j in product(range(3), range(DEPTHS + 1)):
        x, z = _disc(i - 1, (j - 2) / 2)
        corner = (sign, i if sign > 0 else -i, j)
        for m, (station, radius) in enumerate(_LEG_RINGS, start=1):
            centre = np.array([np.interp(station, (0, 1, 2), joints[:, axis]) for axis in range(3)])
            positions["leg", *corner, m] = centre + leg.scale * radius * (x * leg.outward + z * leg.front)
        for m, (height, wide) in enumerate(_HEEL_RINGS, start=len(_LEG_RINGS) + 1):
            positions["leg", *corner, m] = foot.point(-0.006 + 0.028 * z, x * wide, height)
        if j == 0:
            for f, (along, wide, tall) in enumerate(((0.075, 0.024, 0.022), (0.112, 0.016, 0.012)), start=1):
                for r in range(3):
                    positions["forefoot", corner[0], corner[1], r, f] = foot.point(
                        along, (i - 1) * wide, tall * (1 - r / 2)
                    )
    return positions


_ARM_RINGS = ((0.30, 0.031), (0.86, 0.024), (1.14, 0.025), (1.96, 0.016))
_HAND_RINGS = ((0.012, 0.0175, 0.011), (0.040, 0.0205, 0.010), (0.058, 0.0225, 0.008))
"""Along the hand, half breadth, half thickness: thumb's root, its end, knuckles."""


def _arm_positions(body: Landmarks, side: Side) -> dict[Corner, NDArray[np.float64]]:
    positions: dict[Corner, NDArray[np.float64]] = {}
    arm, hand, sign = arm_frame(body, side), hand_frame(body, side), int(side.sign)
    joints = np.array([side.shoulder, side.elbow, side.wrist])
    for j, r in product(range(DEPTHS + 1), range(2)):
        x, z = _arm_section(j, r)
        for a, (station, radius) in enumerate(_ARM_RINGS, start=1):
            centre = np.array([np.interp(station, (0, 1, 2), joints[:, axis]) for axis in range(3)])
            positions["arm", sign, j, r, a] = centre + arm.scale * radius * (x * arm.outward + z * arm.front)
        for a, (along, wide, thick) in enumerate(_HAND_RINGS, start=len(_ARM_RINGS) + 1):
            lateral = wide * (j - 2) / 2
            bow = knuckle_bow(lateral) if a == _ARM_LEVELS else 0.0
            positions["arm", sign, j, r, a] = hand.point(along - bow, (2 * r - 1) * thick, lateral)
    for j, (across, length, radius) in enumerate(reversed(FINGERS)):
        _knuckle, middle, tip = finger_path(hand, across, length)
        for b, centre in enumerate((middle, tip + (tip - middle) * 0.1), start=1):
            for u, r in product(range(2), repeat=2):
                offset = radius * 0.7 * ((2 * u - 1) * hand.front + (2 * r - 1) * hand.outward)
                positions["finger", sign, j, u, r, b] = centre + hand.scale * offset
    _root, middle, tip = thumb_path(hand)
    across = np.cross(tip - middle, hand.outward)
    across *= -np.sign(across @ hand.along) / np.linalg.norm(across)
    for b, centre in enumerate((middle, tip + (tip - middle) * 0.1), start=1):
        for u, r in product(range(2), repeat=2):
            offset = 0.0055 * ((2 * u - 1) * -across + (2 * r - 1) * hand.outward)
            positions["thumb", sign, u, r, b] = centre + hand.scale * offset
    return positions


def _arm_section(j: int, r: int) -> tuple[float, float]:
    """A corner of an arm's ring on the unit circle: outward, front; the narrow sides take 50 degrees."""
    narrow = np.radians(25)
    angle = narrow + (np.pi - 2 * narrow) * (DEPTHS - j) / DEPTHS
    return (1 if r else -1) * float(np.sin(angle)), float(np.cos(angle))
