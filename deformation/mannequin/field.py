"""Shapes as implicit surfaces: lofted limbs and ellipsoids, blended smoothly into one body.

A shape is negative inside, positive outside, and near its surface about the distance to it in metres.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Field = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""From points (N, 3) metres to values (N,) metres."""

_FAR = 0.13
"""Metres from a loft's bounding ball at which its value no longer matters to any blend."""

_SAMPLES = 128


@dataclass(frozen=True, eq=False)
class Loft:
    """Superelliptic cross-sections along a straight axis, closed by half-ellipsoids at both ends.

    origin: (3,) metres. axis, side, front: (3,) orthonormal.
    radii: (S, 4) metres towards +side, -side, +front, -front at even steps of `span`, metres along the axis.
    caps: metres that the first and the last end bulge out.
    exponent: 2 for ellipses, more for boxier sections.
    """

    origin: NDArray[np.float64]
    axis: NDArray[np.float64]
    side: NDArray[np.float64]
    front: NDArray[np.float64]
    span: tuple[float, float]
    radii: NDArray[np.float64]
    caps: tuple[float, float]
    exponent: float = 2.0

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (N,) at points (N, 3); `_FAR` or more from the shape only a lower bound of the distance."""
        centre = self.origin + self.axis * np.mean(self.span)
        reach = (self.span[1] - self.span[0]) / 2 + max(self.caps) + self.radii.max()
        value = np.linalg.norm(points - centre, axis=1) - reach
        near = np.flatnonzero(value < _FAR)
        value[near] = self._value(points[near] - self.origin)
        return value

    def _value(self, offset: NDArray[np.float64]) -> NDArray[np.float64]:
        along, x, z = offset @ self.axis, offset @ self.side, offset @ self.front
        within = np.clip(along, *self.span)
        beyond = along - within
        radius = self._radii_at(within)
        a, b = np.where(x > 0, radius[0], radius[1]), np.where(z > 0, radius[2], radius[3])
        section = (np.abs(x / a) ** self.exponent + np.abs(z / b) ** self.exponent) ** (1 / self.exponent)
        cap = np.where(beyond < 0, self.caps[0], self.caps[1])
        size = np.hypot(section, beyond / cap)
        return np.sqrt(x * x + z * z + beyond * beyond) * (1 - 1 / np.maximum(size, 1e-6))

    def _radii_at(self, along: NDArray[np.float64]) -> NDArray[np.float64]:
        """(4, N) metres."""
        last = len(self.radii) - 1
        step = (along - self.span[0]) * (last / max(self.span[1] - self.span[0], 1e-12))
        index = np.clip(step.astype(int), 0, last - 1)
        share = (step - index)[:, None]
        return (self.radii[index] * (1 - share) + self.radii[index + 1] * share).T


def loft(
    origin: NDArray[np.float64],
    axis: NDArray[np.float64],
    front: NDArray[np.float64],
    stations: Sequence[float],
    radii: Sequence[Sequence[float]],
    caps: tuple[float, float],
    exponent: float = 2.0,
) -> Loft:
    """A loft through given sections.

    axis, front: (3,) directions; front is made square to the axis, and +side is axis x front: the left of an axis that
    points up. stations: (S,) ascending metres along the axis.
    radii: (S, 4) metres at the stations, joined by monotone cubics (Fritsch and Carlson 1980).
    """
    axis = axis / np.linalg.norm(axis)
    front = front - (front @ axis) * axis
    front = front / np.linalg.norm(front)
    even = np.linspace(stations[0], stations[-1], _SAMPLES)
    smooth = PchipInterpolator(stations, np.asarray(radii, float))(even)
    return Loft(origin, axis, np.cross(axis, front), front, (stations[0], stations[-1]), smooth, caps, exponent)


def ellipsoid(
    centre: NDArray[np.float64],
    radii: Sequence[float],
    axis: NDArray[np.float64] | None = None,
    front: NDArray[np.float64] | None = None,
) -> Loft:
    """An ellipsoid with radii (side, axis, front) metres; upright and facing +Z unless turned."""
    axis = np.array([0.0, 1.0, 0.0]) if axis is None else axis
    front = np.array([0.0, 0.0, 1.0]) if front is None else front
    side, along, ahead = radii
    tiny = 1e-6
    sections = [[side, side, ahead, ahead]] * 2
    return loft(centre, axis, front, [-tiny, tiny], sections, (along, along))


def near(field: Field, centre: NDArray[np.float64], reach: float) -> Field:
    """The same shape, asked only about points near a ball around it: centre (3,), radius `reach` metres."""

    def bounded(points: NDArray[np.float64]) -> NDArray[np.float64]:
        value = np.linalg.norm(points - centre, axis=1) - reach
        close = np.flatnonzero(value < _FAR)
        value[close] = field(points[close])
        return value

    return bounded


def smooth_union(a: NDArray[np.float64], b: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """Cubic smooth minimum (I. Quilez, "Smooth minimum"): the plain one where the two differ by more than `width`."""
    overlap = np.maximum(width - np.abs(a - b), 0) / width
    return np.minimum(a, b) - overlap**3 * (width / 6)


def smooth_cut(a: NDArray[np.float64], b: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """What of shape `a` is outside of shape `b`, its new edge rounded."""
    return -smooth_union(-a, b, width)


def gradient(field: Field, points: NDArray[np.float64], value: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) by differences around the values (N,) at points (N, 3): central in x, so that what is the same left and
    right stays so, and forward in y and z."""
    step = 1e-5
    along = [field(points + step * unit) for unit in np.eye(3)]
    right = field(points - [step, 0.0, 0.0])
    return np.stack([(along[0] - right) / 2, along[1] - value, along[2] - value], axis=1) / step


def project(
    field: Field, points: NDArray[np.float64], longest: float = 0.03
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (N, 3) after a Newton step towards the surface of at most `longest` metres, and unit normals (N, 3)."""
    value = field(points)
    slope = gradient(field, points, value)
    norm = np.maximum(np.linalg.norm(slope, axis=1), 0.3)[:, None]
    return points - slope * np.clip(value[:, None] / norm, -longest, longest) / norm, slope / norm
