"""Feet: where each one is planted and when, and the path of the ankle that keeps planted feet still."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.motion_library.axes import about_y, turned
from reconstruction.motion_library.easing import bump, smooth_step
from reconstruction.skeleton import Skeleton

Array = NDArray[np.float64]

HEEL_BACK = 0.030
"""The heel's floor contact behind the ankle, as a share of stature."""


@dataclass(frozen=True)
class Plants:
    """One foot's plants in time order, K of them; the first began before the clip and the last never ends.

    start, end: (K,) seconds. position: (K, 3) metres, the ankle over the flat foot. turn: (K,) radians about up.
    """

    start: Array
    end: Array
    position: Array
    turn: Array


@dataclass(frozen=True)
class FootShape:
    """Contact points of a foot, (forward, up) metres: heel and ball joint from the ankle, toe tip from the ball joint.

    height: metres of the ankle above the floor while the foot is flat.
    """

    heel: tuple[float, float]
    ball: tuple[float, float]
    tip: tuple[float, float]
    height: float

    @classmethod
    def of(cls, skeleton: Skeleton) -> "FootShape":
        """The left foot of a standard body: the ball joint at the toe base, the heel behind and below the ankle."""
        offset = {name: skeleton.offsets[i] for i, name in enumerate(skeleton.names)}
        height = float(sum(offset[name][1] for name in ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot")))
        ball, tip = ((float(o[2]), float(o[1])) for o in (offset["LeftToeBase"], offset["LeftToeBase_end"]))
        return cls((-HEEL_BACK * height / 0.039, -height), ball, tip, height)

    def ankle_over(self, pitch: Array) -> tuple[Array, Array]:
        """Forward and up (T,) metres of the ankle against the flat foot's, rolled about heel (pitch > 0) or ball."""
        forward, up = (np.where(pitch > 0, self.heel[i], self.ball[i]) for i in range(2))
        cosine, sine = np.cos(pitch), np.sin(pitch)
        return forward - (forward * cosine - up * sine), self.height + up - (forward * sine + up * cosine)

    def clear_height(self, pitch: Array, toe_bend: Array) -> Array:
        """(T,) metres: the lowest ankle at which heel, ball and toe tip are not below where they rest on the floor."""
        sine, cosine = np.sin(pitch), np.cos(pitch)
        heel = -(self.heel[0] * sine + self.heel[1] * cosine)
        ball = self.height + self.ball[1] - (self.ball[0] * sine + self.ball[1] * cosine)
        toe = pitch + toe_bend
        tip = ball + self.tip[1] - (self.tip[0] * np.sin(toe) + self.tip[1] * np.cos(toe))
        return np.maximum(np.maximum(heel, ball), tip)


@dataclass(frozen=True)
class Swing:
    """How a foot travels between plants, (T,) each.

    share: 0 at lift-off to 1 at touch-down, 0 while planted. planted: True on the floor. previous, following: plant
    numbers.
    """

    share: Array
    planted: NDArray[np.bool_]
    previous: NDArray[np.int64]
    following: NDArray[np.int64]


def swing_of(plants: Plants, times: Array) -> Swing:
    """The swing state of a foot at each time (T,) seconds."""
    previous = np.clip(np.searchsorted(plants.start, times, side="right") - 1, 0, len(plants.start) - 1)
    following = np.minimum(previous + 1, len(plants.start) - 1)
    lift, land = plants.end[previous], plants.start[following]
    planted = (times <= lift) | (following == previous)
    share = np.where(planted, 0.0, (times - lift) / np.maximum(land - lift, 1e-6))
    return Swing(share, planted, previous, following)


def ankle_path(
    plants: Plants,
    times: Array,
    shape: FootShape,
    pitch: Array,
    free: Array,
    gait: Array,
    lift: Array,
    launched: bool = False,
) -> Array:
    """(T, 3) metres: the ankle, locked to its plants and free between them.

    times: (T,) seconds; pitch: (T,) radians. free: (T, 3) where the gait's joint angles alone would have the ankle.
    gait: (T,) 0 to 1, how far a swing follows them rather than a straight step. lift: (T,) metres, how high a straight
    step rises. launched: the feet leave the floor with the body's speed, as in a jump. Between two
    plants the free path is carried over by a cubic that takes up the difference in place and velocity at lift-off and
    touch-down, so that neither jumps.
    """
    swing = swing_of(plants, times)
    forward, up = shape.ankle_over(pitch)
    roll = np.stack([np.zeros_like(forward), up, forward], axis=-1)
    locked = [plants.position[k] + turned(about_y(plants.turn[k]), roll) for k in range(len(plants.start))]
    path = np.empty_like(free)
    for k, held in enumerate(locked):
        here = (swing.previous == k) & swing.planted
        path[here] = held[here]
        flying = (swing.previous == k) & ~swing.planted
        if flying.any():
            ends = (plants.end[k], plants.start[k + 1])
            carried = free + _carry(times, ends, held - free, locked[k + 1] - free, launched)
            mix = smooth_step(swing.share)[:, None]
            straight = held + mix * (locked[k + 1] - held)
            straight[:, 1] += lift * bump(swing.share)
            path[flying] = (straight + gait[:, None] * (carried - straight))[flying]
    floor = shape.clear_height(pitch, toe_bend(swing, pitch)) + 0.012 * bump(swing.share)
    path[:, 1] = _soft_floor(path[:, 1], floor, 0.02 * bump(swing.share))
    return path


def _carry(times: Array, ends: tuple[float, float], first: Array, last: Array, launched: bool) -> Array:
    """(T, 3) the cubic between two times that begins as `first` (T, 3) goes there and ends as `last` goes there."""
    span = max(ends[1] - ends[0], 1e-6)
    u = np.clip((times - ends[0]) / span, 0.0, 1.0)[:, None]
    place, speed = _at(times, first, ends[0])
    coming, slowing = _at(times, last, ends[1])
    slowing[1] = 0.0  # a foot may strike the floor
    speed = speed * (not launched)
    return (
        (1 + 2 * u) * (1 - u) ** 2 * place
        + u * (1 - u) ** 2 * span * speed
        + u * u * (3 - 2 * u) * coming
        + u * u * (u - 1) * span * slowing
    )


def _at(times: Array, values: Array, moment: float) -> tuple[Array, Array]:
    """Value (3,) and rate (3,) a second of evenly sampled values (T, 3) at a moment."""
    step = times[1] - times[0]
    around = [np.array([np.interp(moment + d, times, values[:, i]) for i in range(3)]) for d in (-step, 0.0, step)]
    return around[1], (around[2] - around[0]) / (2 * step)


def foot_turn(plants: Plants, swing: Swing) -> Array:
    """(T,) radians about up: each plant's own, eased between them."""
    last, coming = plants.turn[swing.previous], plants.turn[swing.following]
    return last + smooth_step(swing.share) * (coming - last)


def toe_bend(swing: Swing, pitch: Array) -> Array:
    """(T,) radians: the toes stay flat on the floor while the heel is up, and relax in the air."""
    return np.maximum(-pitch, 0.0) * np.where(swing.planted, 1.0, 1 - smooth_step(swing.share / 0.5))


def _soft_floor(height: Array, floor: Array, softness: Array) -> Array:
    """The greater of both, its corner rounded over `softness` metres; exact where that is 0."""
    return 0.5 * (height + floor + np.sqrt((height - floor) ** 2 + softness**2))
