"""What the parsers share about positions and turns: plausibility, Euler angles, the sample in `RUB` axes."""

from math import asin, atan2, cos, degrees, radians, sin, sqrt

from devices.axes import Axes, Quaternion, Vector

IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)
FORWARD_RIGHT_DOWN = Axes("FRD")
"""A magnetic transmitter's axes: x out of the source, y right, z down."""

INCH_M = 0.0254

POOR_QUALITY = 0.1
"""For samples whose signal the device calls weak without giving a number."""

FARTHEST_M = 50.0
"""Farther than any tracker here can be: such a position is a broken frame."""


def plausible_position(position: Vector) -> bool:
    """Whether each metre value is a finite number within reach."""
    return all(-FARTHEST_M < value < FARTHEST_M for value in position)


def unit_quaternion(q: Quaternion) -> Quaternion | None:
    """The quaternion (x, y, z, w) made a unit one; None where its length is more than a tenth away from 1."""
    x, y, z, w = q
    square = x * x + y * y + z * z + w * w
    if not 0.81 < square < 1.21:
        return None
    scale = 1.0 / sqrt(square)
    return (x * scale, y * scale, z * scale, w * scale)


def plausible_euler(angles: Vector) -> bool:
    """Whether azimuth, elevation, roll in degrees are within the ranges devices send."""
    azimuth, elevation, roll = angles
    return -180.1 < azimuth < 180.1 and -90.1 < elevation < 90.1 and -180.1 < roll < 180.1


def quaternion_from_euler(angles: Vector) -> Quaternion:
    """(x, y, z, w) of azimuth, elevation, roll in degrees: turns about z, then the new y, then the new x."""
    (cz, sz), (cy, sy), (cx, sx) = ((cos(radians(a) / 2), sin(radians(a) / 2)) for a in angles)
    return (
        cz * cy * sx - sz * sy * cx,
        cz * sy * cx + sz * cy * sx,
        sz * cy * cx - cz * sy * sx,
        cz * cy * cx + sz * sy * sx,
    )


def euler_from_quaternion(q: Quaternion) -> Vector:
    """Azimuth, elevation, roll in degrees of a unit quaternion (x, y, z, w); at elevation 90 the roll is 0."""
    x, y, z, w = q
    sine = max(-1.0, min(1.0, 2 * (w * y - x * z)))
    if abs(sine) > 1 - 1e-12:
        return (degrees(-2 * atan2(x, w) if sine > 0 else 2 * atan2(x, w)), degrees(asin(sine)), 0.0)
    return (
        degrees(atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))),
        degrees(asin(sine)),
        degrees(atan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y))),
    )
