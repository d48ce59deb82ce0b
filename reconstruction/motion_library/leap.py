"""Jumps: a crouch, a push, a ballistic flight, a landing that gives way; and the feet that go with it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from reconstruction.motion_library.axes import about_y, turned
from reconstruction.motion_library.easing import keyed
from reconstruction.motion_library.footwork import FootShape, ankle_path, swing_of, toe_bend
from reconstruction.motion_library.gait_tables import GRAVITY
from reconstruction.motion_library.locomotion import Gait
from reconstruction.motion_library.performance import Performance

Array = NDArray[np.float64]

_CROUCH_S, _PUSH_S, _GIVE_S, _RISE_S = 0.48, 0.30, 0.24, 0.60
"""Seconds of counter-movement, push, landing and standing up: Bobbert and van Ingen Schenau (1988), rounded."""
_TOES_HIGH = 0.06
"""Metres by which the hips at take-off, legs straight and on the toes, are above their height in standing."""


@dataclass(frozen=True)
class Leap:
    """One jump. start: seconds, when the crouch begins; height: metres the hips fly; depth: metres of the crouch."""

    start: float
    height: float
    depth: float = 0.24

    @property
    def speed(self) -> float:
        """m/s upward at take-off, by v^2 = 2 g h."""
        return float(np.sqrt(2 * GRAVITY * self.height))

    @property
    def take_off(self) -> float:
        """Seconds at which the toes leave the floor."""
        return self.start + _CROUCH_S + _PUSH_S

    @property
    def landing(self) -> float:
        """Seconds at which they touch it again."""
        return self.take_off + 2 * self.speed / GRAVITY

    @property
    def end(self) -> float:
        """Seconds at which the body stands again."""
        return self.landing + _GIVE_S + _RISE_S

    @cached_property
    def _rise(self) -> BPoly:
        """Metres of the hips above standing: quintics through place, speed, acceleration; the flight is a parabola."""
        give = 0.55 * self.depth + 0.25 * self.height
        knots = [self.start, self.start + _CROUCH_S, self.take_off, self.landing, self.landing + _GIVE_S, self.end]
        states = [
            [0, 0, 0], [-self.depth, 0, 8], [_TOES_HIGH, self.speed, -GRAVITY], [_TOES_HIGH, -self.speed, -GRAVITY],
            [-give, 0, 8], [0, 0, 0],
        ]  # fmt: skip
        return BPoly.from_derivatives(knots, states)

    def sink(self, times: Array) -> Array:
        """(T,) metres the pelvis is below its standing height; negative while it flies."""
        inside = (times > self.start) & (times < self.end)
        return np.where(inside, -self._rise(np.clip(times, self.start, self.end)), 0.0)

    def toes_down(self, times: Array) -> Array:
        """(T,) radians of the foot, toes down negative: rolling up to the toes, hanging, landing on the balls."""
        keys = [
            (self.start, 0), (self.take_off - 0.17, 0), (self.take_off, -58), (self.take_off + 0.08, -60),
            (0.5 * (self.take_off + self.landing), -38), (self.landing, -30), (self.landing + 0.10, 0), (self.end, 0),
        ]  # fmt: skip
        return np.radians(keyed(times, np.array([k[0] for k in keys]), np.array([k[1] for k in keys], float), 0.015))

    def effort(self, times: Array) -> tuple[Array, Array]:
        """(T,) forward lean of the trunk and (T,) forward swing of the arms in radians, over the jump."""
        lean = [(0, 0), (0.42, 34), (0.62, 26), (0.80, 3), (0.0, 0), (0.10, 14), (0.28, 24), (0.85, 0)]
        arms = [(0, 0), (0.40, -48), (0.55, -30), (0.80, 125), (0.0, 105), (0.12, 55), (0.30, 22), (0.85, 0)]
        at = [self.start + s for s, _ in lean[:4]] + [self.landing + s for s, _ in lean[4:]]
        swing_at = [self.start + s for s, _ in arms[:4]] + [self.landing + s for s, _ in arms[4:]]
        return (
            np.radians(keyed(times, np.array(at), np.array([v for _, v in lean], float), 0.04)),
            np.radians(keyed(times, np.array(swing_at), np.array([v for _, v in arms], float), 0.04)),
        )


def leap(p: Performance, planned: Gait, jump: Leap) -> None:
    """Lays one jump over a performance whose course has it: feet, trunk and arms."""
    lean, swing = jump.effort(p.times)
    p.pelvis_lean += 0.45 * lean
    p.spine_lean += 0.55 * lean
    p.head_nod -= 0.7 * lean
    p.arm_flex += swing[:, None]
    p.elbow += 0.25 * np.abs(swing)[:, None]
    p.foot_pitch += jump.toes_down(p.times)[:, None]
    shape, hips = FootShape.of(p.skeleton), p.hips()
    during = (p.times >= jump.start) & (p.times <= jump.end)
    for side in range(2):
        plants = planned.plants[side]
        free = _hanging(p, planned, hips[:, side], side)
        swing_state = swing_of(plants, p.times)
        ones, flat = np.ones(len(p.times)), np.zeros(len(p.times))
        path = ankle_path(plants, p.times, shape, p.foot_pitch[:, side], free, ones, flat, launched=True)
        p.ankle[during, side] = path[during]
        p.toe_bend[during, side] = toe_bend(swing_state, p.foot_pitch[:, side])[during]


def without_gait(planned: Gait, times: Array, jump: Leap) -> Gait:
    """The plan with no walking or running in it while the body jumps, however fast it flies forward."""
    outside = (times < jump.start) | (times > jump.end)
    return replace(planned, vigour=planned.vigour * outside, running=planned.running * outside)


def _hanging(p: Performance, planned: Gait, hip: Array, side: int) -> Array:
    """(T, 3) metres: the ankle under its hip with the knee a little bent, as legs hang in the air."""
    length = -(p.offset("LeftLeg")[1] + p.offset("LeftFoot")[1])
    outward = turned(about_y(planned.heading), np.array([0.03 * (1 - 2 * side), -0.93 * length, 0.02]))
    return hip + outward
