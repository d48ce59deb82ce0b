"""The curve skeleton: the centres of the curves around a limb, and where that line bends (paper section 5)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.isocurves import IsoCurves, Tubes
from deformation.isocurves_geodesic import Rings
from deformation.kernel import kernel
from devices.frame import frozen

MINIMAL_BEND = np.radians(20)
"""A centre line that turns by less has no joint of its own there (paper fig. 4b)."""


@dataclass(frozen=True, eq=False)
class CentreLine:
    """A limb's middle, from its tip to the trunk.

    points: (N, 3) metres; girths: (N,) metres around it; arcs: (N,) metres along it from the first point.
    """

    points: NDArray[np.float64]
    girths: NDArray[np.float64]
    arcs: NDArray[np.float64]

    @property
    def length(self) -> float:
        """Metres from end to end."""
        return float(self.arcs[-1])

    def at(self, arc: float) -> NDArray[np.float64]:
        """(3,) the point so many metres from the tip."""
        return np.array([np.interp(arc, self.arcs, self.points[:, i]) for i in range(3)])

    def nearest_arc(self, point: NDArray[np.float64]) -> float:
        """Metres from the tip to the line's vertex nearest a point (3,)."""
        return float(self.arcs[np.argmin(np.linalg.norm(self.points - point, axis=1))])

    def between(self, low: float, high: float) -> "CentreLine":
        """The part between two arc lengths, ends interpolated."""
        inside = (self.arcs > low) & (self.arcs < high)
        points = np.concatenate([[self.at(low)], self.points[inside], [self.at(high)]])
        return line_through(points, np.interp(np.r_[low, self.arcs[inside], high], self.arcs, self.girths))

    def narrowest(self, low: float, high: float) -> float:
        """Metres from the tip to the least girth between two arc lengths."""
        inside = np.flatnonzero((self.arcs >= low) & (self.arcs <= high))
        return float(self.arcs[inside[np.argmin(self.girths[inside])]]) if len(inside) else (low + high) / 2

    def waist(self, low: float, high: float) -> float | None:
        """As `narrowest`, but None where the girth only falls or rises between the two."""
        place = self.narrowest(low, high)
        margin = 0.1 * (high - low)
        return place if low + margin < place < high - margin else None

    def widest(self, low: float, high: float) -> float:
        """Metres from the tip to the greatest girth between two arc lengths."""
        inside = np.flatnonzero((self.arcs >= low) & (self.arcs <= high))
        return float(self.arcs[inside[np.argmax(self.girths[inside])]]) if len(inside) else (low + high) / 2

    def widens(self, share: float, high: float) -> float:
        """Metres from the tip to the first ring as long as that share of the longest before an arc length."""
        before = self.girths[self.arcs <= high]
        return float(self.arcs[np.argmax(before >= share * before.max())])

    def axis(self, low: float, high: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The straight line that fits best between two arc lengths: a point (3,) and a unit direction (3,) tipwards."""
        part = self.between(low, high).points
        middle = part.mean(axis=0)
        direction = np.linalg.svd(part - middle)[2][0]
        return middle, direction * (1.0 if direction @ (part[0] - part[-1]) > 0 else -1.0)


def line_through(points: NDArray[np.float64], girths: NDArray[np.float64]) -> CentreLine:
    """A centre line of points (N, 3) and girths (N,), in order."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return CentreLine(frozen(points), frozen(girths), frozen(np.r_[0.0, np.cumsum(steps)]))


def centre_line(tip: NDArray[np.float64], rings: Rings) -> CentreLine:
    """From the tip (3,) through the rings' centres, smoothed over three of them against jitter."""
    points = rings.centres.copy()
    if len(points) > 2:
        points[1:-1] = (rings.centres[:-2] + 2 * rings.centres[1:-1] + rings.centres[2:]) / 4
    return line_through(np.concatenate([[tip], points]), np.r_[0.0, rings.girths])


def sharpest_bend(line: CentreLine) -> tuple[float, float]:
    """Where a line bends most and by how much: the arc length of the point farthest from its chord, and radians.

    The angle is that between the two chords, as of the down-sampled line (paper fig. 4c).
    """
    start, end = line.points[0], line.points[-1]
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-12)
    offset = line.points - start
    away = np.linalg.norm(offset - np.outer(offset @ along, along), axis=1)
    corner = int(np.argmax(away))
    return float(line.arcs[corner]), turn_between(line.points[corner] - start, end - line.points[corner])


def outward(line: CentreLine, arc: float) -> NDArray[np.float64]:
    """(3,) from the line at a bend to the corner at which the straight parts on both sides would meet.

    The line itself cuts the corner, as the curves around a bent joint lie askew. Only what is across the line counts:
    along it the meeting of two lines is ill known. No more than the limb's radius.
    """
    p, u = line.axis(0.15 * arc, 0.75 * arc)
    rest = line.length - arc
    q, v = line.axis(arc + 0.25 * rest, arc + 0.85 * rest)
    # The nearest points of two straight lines p + s u, q + t v.
    across = max(1 - (u @ v) ** 2, 1e-12)
    s = ((q - p) @ u - ((q - p) @ v) * (u @ v)) / across
    t = -((q - p) @ v - ((q - p) @ u) * (u @ v)) / across
    offset = (p + s * u + q + t * v) / 2 - line.at(arc)
    along = (u + v) / max(float(np.linalg.norm(u + v)), 1e-12)
    offset = offset - (offset @ along) * along
    radius = float(np.interp(arc, line.arcs, line.girths)) / (2 * np.pi)
    return offset * min(1.0, radius / max(float(np.linalg.norm(offset)), 1e-12))


def turn_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Radians between two directions (3,); 0 where one has no length."""
    sizes = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.arccos(np.clip(a @ b / sizes, -1, 1))) if sizes > 0 else 0.0


def downsampled(line: CentreLine, least: float = MINIMAL_BEND) -> NDArray[np.intp]:
    """(K,) the vertices at which a line turns by at least `least` radians, both ends among them.

    The line is split at its sharpest bend, and so on in both halves, while the bend there is sharp enough.
    """
    kept = {0, len(line.points) - 1}
    waiting = [(0, len(line.points) - 1)]
    while waiting:
        low, high = waiting.pop()
        if high - low < 2:
            continue
        part = line_through(line.points[low : high + 1], line.girths[low : high + 1])
        arc, bend = sharpest_bend(part)
        corner = low + int(np.argmin(np.abs(part.arcs - arc)))
        if bend >= least and low < corner < high:
            kept.add(corner)
            waiting += [(low, corner), (corner, high)]
    return np.array(sorted(kept))


@dataclass(frozen=True, eq=False)
class TubeRings:
    """The closed curves of all tubes: where each has its middle, and how long it is.

    curves: (R,) their numbers, tube after tube. centres: (R, 3) metres. girths: (R,) metres.
    """

    curves: NDArray[np.int32]
    centres: NDArray[np.float64]
    girths: NDArray[np.float64]


def tube_rings(vertices: NDArray[np.float64], curves: IsoCurves, tubes: Tubes) -> TubeRings:
    """Means of the curves' vertices along their length; vertices: (V, 3) metres."""
    centres, girths = _ring_means(vertices, curves.vertices, curves.starts, tubes.curves)
    return TubeRings(tubes.curves, frozen(centres), frozen(girths))


def ring_means_reference(vertices: NDArray[np.float64], ring: NDArray[np.int32]) -> tuple[NDArray[np.float64], float]:
    """Centre (3,) and girth of one closed ring of vertices, in plain NumPy."""
    points, ahead = vertices[ring], vertices[np.roll(ring, -1)]
    lengths = np.linalg.norm(ahead - points, axis=1)
    return lengths @ (points + ahead) / 2 / lengths.sum(), float(lengths.sum())


@kernel
def _ring_means(vertices, members, starts, rings):
    centres = np.zeros((len(rings), 3))
    girths = np.zeros(len(rings))
    for r in range(len(rings)):
        begin, end = starts[rings[r]], starts[rings[r] + 1]
        b = members[end - 1]
        for n in range(begin, end):
            a, b = b, members[n]
            x, y, z = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
            length = np.sqrt(x * x + y * y + z * z)
            girths[r] += length
            for i in range(3):
                centres[r, i] += length * (vertices[a, i] + vertices[b, i]) / 2
        if girths[r] > 0:
            for i in range(3):
                centres[r, i] /= girths[r]
    return centres, girths
