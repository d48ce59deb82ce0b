"""Skin as elastic beams along its iso-parametric curves (paper section 6).

The paper bends every curve by E I q'''' + rho A q_tt = F from one example pose to another. A constant force that
meets the second pose exactly does not exist near a resonance, and overshoots wildly beside one. Here the force is what
would carry a smooth target between the examples, F = E I target'''' + rho A target_tt; what the skin adds by its
damping is the lag e = q - target, and that is what is solved for. Divided by rho A, with skin tied to the flesh:

    e_tt + 2 zeta w e_t + (E I / rho A) e'''' + w^2 e = -2 zeta w d_t

with d_t the target's velocity less the rigid motion of the curve as a whole: what is damped is deformation, and a limb
that swings does not leave its skin behind. w is the frequency of the tie, without which a closed curve could drift, and
I / A = thickness^2 / 12. Differences are central in v, fixed in place and tangent at an open curve's ends, periodic on
a closed one; in time Newmark's average acceleration (beta 1/4, gamma 1/2), which is stable for every step and loses no
amplitude.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.isocurves import IsoCurves
from deformation.kernel import kernel
from devices.errors import SettingError

_FEWEST_BENDING = 5
"""A closed curve of fewer vertices has no fourth difference; it only follows its tie."""

_SAME_STEP = 1e-3
"""Steps whose lengths differ by a smaller share are taken as one."""

_EVEN = 1e-6
"""A straight curve's turn about itself is taken as none: added to its moments of inertia, as a share of their sum."""


@dataclass(frozen=True)
class BeamSettings:
    """What the skin is made of. Defaults are of human skin with the fat under it.

    young_modulus_pa: pascal; density_kg_m3; thickness_m: of the beam; frequency_hz: of the skin's swing on the flesh;
    damping_ratio: of that swing, 0 swings for ever, 1 does not overshoot. Raises SettingError out of range.
    """

    young_modulus_pa: float = 2e5
    density_kg_m3: float = 1100.0
    thickness_m: float = 0.01
    frequency_hz: float = 4.0
    damping_ratio: float = 0.35

    def __post_init__(self) -> None:
        for name in ("young_modulus_pa", "density_kg_m3", "thickness_m", "frequency_hz"):
            if not getattr(self, name) > 0:
                raise SettingError(f"{name} is {getattr(self, name)}: it must be above 0")
        if not 0 <= self.damping_ratio <= 2:
            raise SettingError(f"damping_ratio is {self.damping_ratio}: use 0 to 2")

    @property
    def bending(self) -> float:
        """E I / (rho A) in m^4 / s^2."""
        return self.young_modulus_pa * self.thickness_m**2 / 12 / self.density_kg_m3


class BeamSkin:
    """All curves of a mesh as beams that lag behind moving targets.

    rest: (V, 3) metres, the shape that curve lengths are taken from. dt_s: seconds a step, unless one has its own.
    Raises SettingError for a step that is not above 0.
    """

    def __init__(
        self, curves: IsoCurves, rest: NDArray[np.float64], dt_s: float, settings: BeamSettings | None = None
    ) -> None:
        self._settings = settings or BeamSettings()
        self._rest = np.array(rest)
        self._members, self._starts, self._closed = curves.vertices, curves.starts, curves.closed
        self._share = 1.0 / np.maximum(np.bincount(curves.vertices, minlength=len(rest)), 1)
        w = 2 * np.pi * self._settings.frequency_hz
        self._tie, self._drag = w * w, 2 * self._settings.damping_ratio * w
        stiffness = self._settings.bending / spacings(curves, rest) ** 4
        self._stiffness = np.where(np.diff(curves.starts) < np.where(curves.closed, _FEWEST_BENDING, 3), 0.0, stiffness)
        self._set_step(dt_s)
        size = len(curves.vertices)
        self._e, self._v, self._a, self._right = (np.zeros((size, 3)) for _ in range(4))

    def _set_step(self, dt_s: float) -> None:
        if not dt_s > 0:
            raise SettingError(f"the step is {dt_s} s: it must be above 0")
        self._dt = dt_s
        mass = 1 + self._drag * dt_s / 2 + self._tie * dt_s**2 / 4
        self._factor = _factor(self._starts, self._closed, self._stiffness * dt_s**2 / 4, mass)

    def step(
        self,
        target: NDArray[np.float64],
        target_velocity: NDArray[np.float64],
        out: NDArray[np.float64],
        dt_s: float | None = None,
    ) -> None:
        """One step on: writes the displacement (V, 3) metres into `out`.

        target, target_velocity: (V, 3) metres and metres a second at the step's end. dt_s: seconds, where not as
        before; the system is then factored anew.
        """
        if dt_s is not None and abs(dt_s - self._dt) > _SAME_STEP * self._dt:
            self._set_step(dt_s)
        _deforming(self._rest, target, target_velocity, self._members, self._starts, self._right)
        _step(
            self._starts, self._closed, self._stiffness, self._factor, self._drag, self._tie,
            self._dt, self._e, self._v, self._a, self._right,
        )  # fmt: skip
        _gather(self._members, self._share, self._e, target, out)

    def rest(self) -> None:
        """Stops all lag."""
        for state in (self._e, self._v, self._a):
            state[:] = 0.0

    def lag(self) -> NDArray[np.float64]:
        """(N, 3) metres behind the target, node by node as `IsoCurves.vertices`."""
        return self._e.copy()

    def energy(self) -> float:
        """The lag's kinetic and elastic energy over mass, m^2 / s^2: constant if undamped while the target is still."""
        bent = sum(
            self._stiffness[c] * np.einsum("ni,ni->", e, fourth_difference(e, bool(self._closed[c])))
            for c, e in enumerate(np.split(self._e, self._starts[1:-1]))
        )
        tied = self._tie * np.einsum("ni,ni->", self._e, self._e)
        return float((np.einsum("ni,ni->", self._v, self._v) + tied + bent) / 2)

    def push(self, velocity: NDArray[np.float64]) -> None:
        """Adds a velocity (N, 3) metres a second to every node but the fixed ends of open curves."""
        self._v += velocity
        ends = np.r_[self._starts[:-1][~self._closed], self._starts[1:][~self._closed] - 1]
        self._v[ends] = 0
        self._a[:] = -self._drag * self._v - self._tie * self._e
        for c, (begin, end) in enumerate(zip(self._starts[:-1], self._starts[1:], strict=True)):
            self._a[begin:end] -= self._stiffness[c] * fourth_difference(self._e[begin:end], bool(self._closed[c]))
        self._a[ends] = 0


def spacings(curves: IsoCurves, rest: NDArray[np.float64]) -> NDArray[np.float64]:
    """(C,) metres between neighbouring vertices of each curve, on average."""
    points = rest[curves.vertices]
    ahead = np.roll(points, -1, axis=0)
    ahead[curves.starts[1:] - 1] = points[curves.starts[:-1]]
    lengths = np.linalg.norm(ahead - points, axis=1)
    lengths[curves.starts[1:][~curves.closed] - 1] = 0
    count = np.diff(curves.starts) - ~curves.closed
    return np.maximum(np.add.reduceat(lengths, curves.starts[:-1]) / np.maximum(count, 1), 1e-6)


def fourth_difference(values: NDArray[np.float64], closed: bool) -> NDArray[np.float64]:
    """(n, 3) central fourth difference of a curve's nodes (n, 3): the plain reference.

    An open curve's end nodes are fixed at 0 with no slope, so that the node beyond mirrors the one within.
    """
    if len(values) < (_FEWEST_BENDING if closed else 3):
        return np.zeros_like(values)
    if closed:
        return sum(k * np.roll(values, s, axis=0) for k, s in ((1, -2), (-4, -1), (6, 0), (-4, 1), (1, 2)))  # type: ignore[return-value]
    wide = np.concatenate([values[1:2], values, values[-2:-1]])
    inner = wide[:-4] - 4 * wide[1:-3] + 6 * wide[2:-2] - 4 * wide[3:-1] + wide[4:]
    return np.concatenate([np.zeros_like(values[:1]), inner, np.zeros_like(values[:1])])


def deforming_reference(points: NDArray[np.float64], velocities: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) velocities of a curve's points (n, 3) less those of the rigid motion nearest to them, in plain NumPy."""
    r, u = points - points.mean(axis=0), velocities - velocities.mean(axis=0)
    inertia = np.einsum("ni,ni->", r, r) * (1 + _EVEN) * np.eye(3) - r.T @ r
    return u - np.cross(np.linalg.solve(inertia, np.cross(r, u).sum(axis=0)), r)


@kernel
def _deforming(rest, target, velocity, members, starts, out):
    """`deforming_reference` for every curve, its points being rest + target: writes (N, 3)."""
    c, u, spin = np.empty(3), np.empty(3), np.empty(3)
    m, r = np.empty((3, 3)), np.empty(3)
    for curve in range(len(starts) - 1):
        begin, end = starts[curve], starts[curve + 1]
        c[:] = 0.0
        u[:] = 0.0
        for n in range(begin, end):
            vertex = members[n]
            for i in range(3):
                c[i] += rest[vertex, i] + target[vertex, i]
                u[i] += velocity[vertex, i]
        for i in range(3):
            c[i] /= end - begin
            u[i] /= end - begin
        m[:] = 0.0
        spin[:] = 0.0
        for n in range(begin, end):
            vertex = members[n]
            x = rest[vertex, 0] + target[vertex, 0] - c[0]
            y = rest[vertex, 1] + target[vertex, 1] - c[1]
            z = rest[vertex, 2] + target[vertex, 2] - c[2]
            p, q, s = velocity[vertex, 0] - u[0], velocity[vertex, 1] - u[1], velocity[vertex, 2] - u[2]
            spin[0] += y * s - z * q
            spin[1] += z * p - x * s
            spin[2] += x * q - y * p
            m[0, 0] += y * y + z * z
            m[1, 1] += x * x + z * z
            m[2, 2] += x * x + y * y
            m[0, 1] -= x * y
            m[0, 2] -= x * z
            m[1, 2] -= y * z
        even = _EVEN * (m[0, 0] + m[1, 1] + m[2, 2]) / 2 + 1e-300
        a, b, d = m[0, 0] + even, m[1, 1] + even, m[2, 2] + even
        f, g, h = m[0, 1], m[0, 2], m[1, 2]
        # The inverse of a symmetric 3 x 3 matrix by its cofactors.
        c00, c01, c02 = b * d - h * h, g * h - f * d, f * h - g * b
        c11, c12, c22 = a * d - g * g, f * g - a * h, a * b - f * f
        det = a * c00 + f * c01 + g * c02
        wx = (c00 * spin[0] + c01 * spin[1] + c02 * spin[2]) / det
        wy = (c01 * spin[0] + c11 * spin[1] + c12 * spin[2]) / det
        wz = (c02 * spin[0] + c12 * spin[1] + c22 * spin[2]) / det
        for n in range(begin, end):
            vertex = members[n]
            for i in range(3):
                r[i] = rest[vertex, i] + target[vertex, i] - c[i]
            out[n, 0] = velocity[vertex, 0] - u[0] - (wy * r[2] - wz * r[1])
            out[n, 1] = velocity[vertex, 1] - u[1] - (wz * r[0] - wx * r[2])
            out[n, 2] = velocity[vertex, 2] - u[2] - (wx * r[1] - wy * r[0])


@kernel
def _factor(starts, closed, stiffness, mass):
    """(N, 9): per node 1 / d, l1, l2 of the banded L D L', then for closed curves the border's solution W (2) and,
    at the first node, the inverse of its 2 x 2 Schur complement (3) and the stiffness.

    The system is mass + stiffness D4. A closed curve's last two nodes are its border, the others a band.
    """
    factor = np.zeros((starts[-1], 9))
    for c in range(len(closed)):
        begin, end, k = starts[c], starts[c + 1], stiffness[c]
        ring = closed[c] and k > 0
        first, last = begin, end
        if not closed[c]:
            first, last = begin + 1, end - 1
        elif ring:
            last = end - 2
        d1 = d2 = 0.0
        l1_before = 0.0
        for n in range(first, last):
            diagonal = mass + 6 * k
            if not closed[c]:
                # The clamped ends' mirrored nodes add to the first and last free ones.
                if n == first:
                    diagonal += k
                if n == last - 1:
                    diagonal += k
            off1 = -4 * k if n > first else 0.0
            off2 = k if n > first + 1 else 0.0
            l2 = off2 / d2 if d2 > 0 else 0.0
            l1 = (off1 - l2 * d2 * l1_before) / d1 if d1 > 0 else 0.0
            d = diagonal - l1 * l1 * d1 - l2 * l2 * d2
            factor[n, 0] = 1 / d
            factor[n, 1] = l1
            factor[n, 2] = l2
            d2, d1, l1_before = d1, d, l1
        if ring:
            # The border touches the band's first two and last two nodes.
            for column in range(2):
                w = factor[first:last, 3 + column]
                w[:] = 0.0
                if column == 0:
                    w[0] += k
                    w[-1] += -4 * k
                    w[-2] += k
                else:
                    w[0] += -4 * k
                    w[1] += k
                    w[-1] += k
                for n in range(first, last):
                    if n > first:
                        factor[n, 3 + column] -= factor[n, 1] * factor[n - 1, 3 + column]
                    if n > first + 1:
                        factor[n, 3 + column] -= factor[n, 2] * factor[n - 2, 3 + column]
                for n in range(first, last):
                    factor[n, 3 + column] *= factor[n, 0]
                for n in range(last - 2, first - 1, -1):
                    factor[n, 3 + column] -= factor[n + 1, 1] * factor[n + 1, 3 + column]
                    if n + 2 < last:
                        factor[n, 3 + column] -= factor[n + 2, 2] * factor[n + 2, 3 + column]
            s = np.empty((2, 2))
            for column in range(2):
                top = factor[first, 3 + column]
                second = factor[first + 1, 3 + column]
                low = factor[last - 1, 3 + column]
                lower = factor[last - 2, 3 + column]
                s[0, column] = -(k * top - 4 * k * low + k * lower)
                s[1, column] = -(-4 * k * top + k * second + k * low)
            s[0, 0] += mass + 6 * k
            s[1, 1] += mass + 6 * k
            s[0, 1] += -4 * k
            s[1, 0] += -4 * k
            det = s[0, 0] * s[1, 1] - s[0, 1] * s[1, 0]
            factor[begin, 5] = s[1, 1] / det
            factor[begin, 6] = -s[0, 1] / det
            factor[begin, 7] = s[0, 0] / det
            factor[begin, 8] = k
    return factor


@kernel
def _step(starts, closed, stiffness, factor, drag, tie, dt, e, v, a, x):
    """Newmark's step of all lags: moves e, v and a on. x: d_t on the way in, the new accelerations on the way out."""
    half, quarter = dt / 2, dt * dt / 4
    for c in range(len(closed)):
        begin, end, k = starts[c], starts[c + 1], stiffness[c]
        # Predicted lag and velocity without the new acceleration.
        for n in range(begin, end):
            for i in range(3):
                e[n, i] += dt * v[n, i] + quarter * a[n, i]
                v[n, i] += half * a[n, i]
        first, last = begin, end
        if not closed[c]:
            first, last = begin + 1, end - 1
        size = end - begin
        for n in range(first, last):
            for i in range(3):
                force = -drag * (x[n, i] + v[n, i]) - tie * e[n, i]
                if k > 0:
                    if closed[c]:
                        before, after = n - 1, n + 1
                        before2, after2 = n - 2, n + 2
                        if before < begin:
                            before += size
                        if before2 < begin:
                            before2 += size
                        if after >= end:
                            after -= size
                        if after2 >= end:
                            after2 -= size
                        bent = e[before2, i] - 4 * e[before, i] + 6 * e[n, i] - 4 * e[after, i] + e[after2, i]
                    else:
                        before2 = n - 2 if n - 2 >= begin else n
                        after2 = n + 2 if n + 2 < end else n
                        bent = e[before2, i] - 4 * e[n - 1, i] + 6 * e[n, i] - 4 * e[n + 1, i] + e[after2, i]
                    force -= k * bent
                x[n, i] = force
        _solve(begin, end, first, last, closed[c] and k > 0, factor, x)
        for n in range(first, last):
            for i in range(3):
                a[n, i] = x[n, i]
                v[n, i] += half * x[n, i]
                e[n, i] += quarter * x[n, i]


@kernel
def _solve(begin, end, first, last, ring, factor, x):
    """Solves one curve's system in place, with `_factor`'s band and border."""
    if ring:
        last = end - 2
    for n in range(first, last):
        for i in range(3):
            if n > first:
                x[n, i] -= factor[n, 1] * x[n - 1, i]
            if n > first + 1:
                x[n, i] -= factor[n, 2] * x[n - 2, i]
    for n in range(last - 1, first - 1, -1):
        for i in range(3):
            x[n, i] *= factor[n, 0]
            if n + 1 < last:
                x[n, i] -= factor[n + 1, 1] * x[n + 1, i]
            if n + 2 < last:
                x[n, i] -= factor[n + 2, 2] * x[n + 2, i]
    if not ring:
        return
    k = factor[begin, 8]
    for i in range(3):
        p = x[last, i] - k * (x[first, i] - 4 * x[last - 1, i] + x[last - 2, i])
        q = x[last + 1, i] - k * (-4 * x[first, i] + x[first + 1, i] + x[last - 1, i])
        x[last, i] = factor[begin, 5] * p + factor[begin, 6] * q
        x[last + 1, i] = factor[begin, 6] * p + factor[begin, 7] * q
        for n in range(first, last):
            x[n, i] -= factor[n, 3] * x[last, i] + factor[n, 4] * x[last + 1, i]


@kernel
def _gather(members, share, e, target, out):
    """A vertex's displacement: its target and the mean lag of the curves it is on."""
    out[:] = 0.0
    for n in range(len(members)):
        for i in range(3):
            out[members[n], i] += e[n, i]
    for v in range(len(out)):
        for i in range(3):
            out[v, i] = target[v, i] + share[v] * out[v, i]
