"""Flesh that swings after the skin: particles tied to their skinned places and to each other (paper IV, eq. 12-14).

The paper's alpha, step and damping become a frequency in Hz and a damping ratio. A soft particle x is drawn to its
skinned place s with Omega^2, and to its shape matching goal g with as much more as makes s weigh 1 - delta and g delta
in the common goal, so that delta = 0 holds it stiffly to the skin's own motion and delta near 1 lets neighbours swing
together; what is shown is delta x + (1 - delta) s (eq. 14). Shape matching alone would leave nothing tied to the
skeleton. Steps are of fixed length: what is shown lies between the last two, and does not depend on the display's rate.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.kernel import kernel
from deformation.shape_matching import Regions, ShapeMatcher
from devices.errors import SettingError

_STEP_S = 1 / 60
"""The simulation's step, the paper's 16 ms."""

_STALL_S = 0.25
"""After so long without a frame the flesh is taken to be at rest."""

_TELEPORT_M_S = 15.0
"""A body whose particles move faster than this on average has been put elsewhere."""

_FARTHEST = 1.5
"""How far, in cells, a particle may swing from its skinned place before its cells turn inside out."""

_HARDEST = 0.9
"""Limit of h^2 times the total stiffness: 4 would be unstable, 1 follows the goal in one step."""


@dataclass(frozen=True)
class SecondarySettings:
    """How the flesh swings.

    delta: 0 to 0.95, the paper's ratio of secondary deformation; 0 is the skin itself.
    frequency_hz: 0.5 to 12, of a soft part's free swing. damping_ratio: 0 to 2; 1 does not overshoot.
    gravity_m_s2: (3,) a pull beside the one the mesh was modelled under; none by default, so that rest is the skin.
    """

    delta: float = 0.6
    frequency_hz: float = 4.5
    damping_ratio: float = 0.3
    gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name, low, high in (("delta", 0, 0.95), ("frequency_hz", 0.5, 12), ("damping_ratio", 0, 2)):
            if not low <= getattr(self, name) <= high:
                raise SettingError(f"{name} = {getattr(self, name)}: use {low} to {high}")


class SecondaryMotion:
    """The moving state of one character's flesh."""

    def __init__(self, regions: Regions, softness: NDArray[np.float64], cell_size: float) -> None:
        """softness: (P,) 0 (on the bone) to 1, scales delta at each particle. cell_size: metres."""
        self.softness = np.ascontiguousarray(softness, np.float64)
        self._matcher = ShapeMatcher(regions)
        self._farthest = _FARTHEST * cell_size
        size = len(softness)
        self._x, self._v = np.empty((size, 3)), np.empty((size, 3))
        self._skin, self._target, self._velocity = np.empty((size, 3)), np.empty((size, 3)), np.empty((size, 3))
        self._offsets = np.zeros((2, size, 3))
        self._started, self._resting = False, True
        self._ahead_s = 0.0

    def reset(self) -> None:
        """Forgets all motion: the next frame is at rest."""
        self._started = False

    def push(self, velocities_m_s: NDArray[np.float64]) -> None:
        """Adds velocities (3,) or (P, 3) metres a second to the particles: an impulse over their mass."""
        if self._started:
            self._v += velocities_m_s

    def follow(
        self, skin: NDArray[np.float64], dt_s: float, settings: SecondarySettings, shown: NDArray[np.float64]
    ) -> None:
        """Moves on by dt_s seconds to skinned particles (P, 3) metres and writes the particles to show, (P, 3) metres.

        After a stall or a jump of the whole body it starts again at rest.
        """
        if not self._started or dt_s > _STALL_S or self._jumped(skin, dt_s):
            self._rest_on(skin)
        elif dt_s > 0:
            self._advance(skin, dt_s, settings)
        _show(skin, self._offsets[0], self._offsets[1], self._ahead_s / _STEP_S, settings.delta, self.softness, shown)

    def _jumped(self, skin: NDArray[np.float64], dt_s: float) -> bool:
        return not _mean_way(self._skin, skin) <= _TELEPORT_M_S * max(dt_s, _STEP_S)

    def _rest_on(self, skin: NDArray[np.float64]) -> None:
        self._x[:], self._skin[:], self._target[:] = skin, skin, skin
        self._v[:], self._offsets[:] = 0, 0
        self._ahead_s = 0.0
        self._started, self._resting = bool(np.isfinite(skin).all()), True

    def _advance(self, skin: NDArray[np.float64], dt_s: float, settings: SecondarySettings) -> None:
        """Takes the steps that fit between the last frame and this one, along the straight way of the skin.

        Flesh that was put in place a frame ago starts with the skin's velocity: a runner is not hit by the first frame.
        """
        if self._resting:
            self._v += (skin - self._skin) / dt_s
            self._resting = False
        behind, self._ahead_s = self._ahead_s, self._ahead_s + dt_s
        done = 0
        while self._ahead_s >= _STEP_S * (1 - 1e-9):
            done += 1
            self._ahead_s = max(self._ahead_s - _STEP_S, 0.0)
            goals = self._matcher.goals(self._x, self._target)
            _between(self._skin, skin, (done * _STEP_S - behind) / dt_s, self._target, self._velocity)
            self._step(goals, settings)
        self._skin[:] = skin

    def _step(self, goals: NDArray[np.float64], settings: SecondarySettings) -> None:
        self._offsets[0] = self._offsets[1]
        _swing(
            self._x,
            self._v,
            self._target,
            self._velocity,
            goals,
            self.softness,
            settings.delta,
            2 * np.pi * settings.frequency_hz,
            settings.damping_ratio,
            np.asarray(settings.gravity_m_s2, np.float64),
            self._farthest,
            self._offsets[1],
        )


def swing_reference(x, v, skin, skin_velocity, goals, softness, settings: SecondarySettings, farthest: float):
    """One step in plain NumPy: the new x and v, (P, 3) each; arguments as for the kernel `_swing`."""
    delta = settings.delta * softness[:, None]
    omega = 2 * np.pi * settings.frequency_hz
    tie, match = _stiffness(delta, omega)
    before = skin - _STEP_S * skin_velocity
    pull = tie * (before - x) + match * (goals - x) + np.asarray(settings.gravity_m_s2)
    drag = 2 * settings.damping_ratio * omega * _STEP_S
    v = (v + _STEP_S * pull + drag * skin_velocity) / (1 + drag)
    x = x + _STEP_S * v
    offset = x - skin
    length = np.linalg.norm(offset, axis=1, keepdims=True)
    too_far = length > farthest
    x = np.where(too_far, skin + offset * farthest / np.maximum(length, farthest), x)
    v = np.where(too_far | (softness[:, None] <= 0), skin_velocity, v)
    return np.where(softness[:, None] <= 0, skin, x), v


@kernel
def _stiffness(delta, omega):
    """The squared angular frequencies towards the skin and towards the shape matching goal, kept stable."""
    tie = np.minimum(omega * omega, _HARDEST / (_STEP_S * _STEP_S))
    return tie, np.minimum(tie * delta / (1.0 - delta), _HARDEST / (_STEP_S * _STEP_S) - tie)


@kernel
def _swing(x, v, skin, skin_velocity, goals, softness, delta, omega, damping, gravity, farthest, offsets):
    """Eq. 12 and 13 with the goal (1 - delta) s + delta g and damping towards the skin's velocity, in place.

    skin: (P, 3) metres at the end of the step, skin_velocity: (P, 3) metres a second through it. The pulls are those at
    its beginning, where x and the goals are: a skin that moves evenly takes the flesh along without a lag.
    Particles of no softness stay on the skin: those within a bone.
    """
    drag = 2.0 * damping * omega * _STEP_S
    for p in range(len(x)):
        if softness[p] <= 0.0:
            for i in range(3):
                x[p, i], v[p, i], offsets[p, i] = skin[p, i], skin_velocity[p, i], 0.0
            continue
        tie, match = _stiffness(delta * softness[p], omega)
        length = 0.0
        for i in range(3):
            before = skin[p, i] - _STEP_S * skin_velocity[p, i]
            pull = tie * (before - x[p, i]) + match * (goals[p, i] - x[p, i]) + gravity[i]
            v[p, i] = (v[p, i] + _STEP_S * pull + drag * skin_velocity[p, i]) / (1.0 + drag)
            x[p, i] += _STEP_S * v[p, i]
            offsets[p, i] = x[p, i] - skin[p, i]
            length += offsets[p, i] ** 2
        length = np.sqrt(length)
        if length > farthest:
            for i in range(3):
                offsets[p, i] *= farthest / length
                x[p, i], v[p, i] = skin[p, i] + offsets[p, i], skin_velocity[p, i]


@kernel
def _mean_way(before, after):
    """How far, in metres, points (P, 3) have moved in the mean."""
    x, y, z = 0.0, 0.0, 0.0
    for p in range(len(before)):
        x += after[p, 0] - before[p, 0]
        y += after[p, 1] - before[p, 1]
        z += after[p, 2] - before[p, 2]
    return np.sqrt(x * x + y * y + z * z) / len(before)


@kernel
def _between(start, end, way, target, velocity):
    """Where the skin is on the way from one frame to the next, and its mean velocity since the step before."""
    for p in range(len(start)):
        for i in range(3):
            now = start[p, i] + way * (end[p, i] - start[p, i])
            velocity[p, i] = (now - target[p, i]) / _STEP_S
            target[p, i] = now


@kernel
def _show(skin, before, after, share, delta, softness, shown):
    for p in range(len(skin)):
        amount = delta * softness[p]
        for i in range(3):
            shown[p, i] = skin[p, i] + amount * (before[p, i] + share * (after[p, i] - before[p, i]))
