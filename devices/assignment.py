"""Which tracker is on which limb, from a few seconds of walking: by heights, by how limbs move, by side.

Each way of handing out the roles is scored by how likely the trackers' figures are for those limbs. Side comes of the
direction of walking, as left is to the left of where one goes. The tables are anatomy of a person of about 1.7 m
(joint heights after Drillis and Contini 1966) and plain observations of gait, with generous spreads.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from devices.errors import DeviceError
from devices.sample import ROLES, TrackerSample

_RATE_HZ = 30.0
_LONGEST_GAP_S = 0.2
_LEAST_S = 2.0
_WALKING_M_S = 0.25
_SMOOTH_S = 0.5


@dataclass(frozen=True, slots=True)
class _Limb:
    """Mean and spread of: height, side (left is positive), metres; swing, speed against the body over walking speed."""

    height: tuple[float, float]
    side: tuple[float, float]
    swing: tuple[float, float]


_LIMBS = {
    "root": _Limb((0.95, 0.10), (0.0, 0.06), (0.25, 0.15)),
    "head": _Limb((1.55, 0.12), (0.0, 0.08), (0.30, 0.15)),
    "left_wrist": _Limb((0.95, 0.25), (0.28, 0.12), (0.60, 0.30)),
    "right_wrist": _Limb((0.95, 0.25), (-0.28, 0.12), (0.60, 0.30)),
    "left_ankle": _Limb((0.12, 0.08), (0.10, 0.06), (1.00, 0.30)),
    "right_ankle": _Limb((0.12, 0.08), (-0.10, 0.06), (1.00, 0.30)),
}
_HEIGHT_ERROR_M = 0.3
"""How far the device's zero may be from the floor, as a spread."""


@dataclass(frozen=True, slots=True)
class FoundAssignment:
    """roles: tracker -> role. certainty: how much likelier it is than the next best way, as a share of both (0.5 to
    1). walked: whether there was walking; without it left and right are guesses."""

    roles: Mapping[str, str]
    certainty: float
    walked: bool


def find_assignment(samples: Sequence[TrackerSample], roles: Sequence[str] | None = None) -> FoundAssignment:
    """Hands out roles to the trackers in some seconds of samples of one or more devices in one room.

    roles: those that are worn, as many as trackers; by default any of the six. Raises DeviceError where fewer than two
    trackers, more than there are roles, or less than two seconds were seen.
    """
    names, paths = _paths(samples)
    worn = tuple(roles) if roles else ROLES
    if not 2 <= len(names) <= len(worn) or (roles and len(names) != len(roles)):
        wanted = f"the {len(worn)} of the roles worn" if roles else f"2 to {len(ROLES)}"
        raise DeviceError(f"{len(names)} trackers were seen, not {wanted}: check that each is on and in range")
    height, side, swing, walked = _figures(paths)
    fit = np.array([[_misfit(_LIMBS[role], height[i], side[i], swing[i]) for role in worn] for i in range(len(names))])
    ways = [way for chosen in combinations(range(len(worn)), len(names)) for way in permutations(chosen)]
    scores = np.array([_score(fit, height, [worn[r] for r in way], way) for way in ways])
    best, second = np.argsort(scores)[-1:-3:-1]
    certainty = 1.0 / (1.0 + float(np.exp(scores[second] - scores[best])))
    return FoundAssignment({names[i]: worn[r] for i, r in enumerate(ways[best])}, certainty, walked)


def _score(fit: NDArray[np.float64], height: NDArray[np.float64], roles: list[str], way: tuple[int, ...]) -> float:
    """Log-likelihood: side and swing of each, and heights with the floor wherever it fits best."""
    expected = np.array([_LIMBS[role].height[0] for role in roles])
    spread = np.array([_LIMBS[role].height[1] for role in roles])
    weight = 1 / spread**2
    floor = (weight * (height - expected)).sum() / (weight.sum() + 1 / _HEIGHT_ERROR_M**2)
    off = ((height - floor - expected) ** 2 * weight).sum() + (floor / _HEIGHT_ERROR_M) ** 2
    return -0.5 * off - float(np.log(spread).sum()) - sum(fit[i, r] for i, r in enumerate(way))


def _misfit(limb: _Limb, height: float, side: float, swing: float) -> float:
    """Negative log-likelihood of side and swing; NaN counts for nothing."""
    pairs = ((side, limb.side), (swing, limb.swing))
    return sum(0.5 * ((value - m) / s) ** 2 + float(np.log(s)) for value, (m, s) in pairs if np.isfinite(value))


def _paths(samples: Sequence[TrackerSample]) -> tuple[list[str], NDArray[np.float64]]:
    """Trackers' names, and (T, N, 3) where they were at 30 Hz while all were seen."""
    by_tracker: dict[str, list[TrackerSample]] = {}
    for sample in samples:
        if sample.position is not None:
            by_tracker.setdefault(sample.tracker, []).append(sample)
    names = sorted(tracker for tracker, own in by_tracker.items() if len(own) > 10)
    if not names:
        raise DeviceError("no tracker was seen: check that they are on and in range")
    times = {name: np.array([s.host_time_ns for s in by_tracker[name]]) * 1e-9 for name in names}
    grid = np.arange(max(t[0] for t in times.values()), min(t[-1] for t in times.values()), 1 / _RATE_HZ)
    columns, seen = [], np.ones(len(grid), bool)
    for name in names:
        places = np.array([s.position for s in by_tracker[name]])
        columns.append(np.stack([np.interp(grid, times[name], places[:, axis]) for axis in range(3)], 1))
        after = np.clip(np.searchsorted(times[name], grid), 1, len(places) - 1)
        seen &= np.diff(times[name])[after - 1] <= _LONGEST_GAP_S
    if seen.sum() < _LEAST_S * _RATE_HZ:
        raise DeviceError(f"the trackers were seen together for {seen.sum() / _RATE_HZ:.1f} s only: walk for 5 seconds")
    return names, np.stack(columns, 1)[seen]


def _figures(
    paths: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], bool]:
    """Of each tracker: mean height, mean place to the left, speed against the body over walking speed (N,); walked.

    The body is the middle of all trackers, smoothed over half a second; it walks along its own horizontal velocity.
    """
    height = paths[..., 1].mean(0)
    window = max(3, round(_SMOOTH_S * _RATE_HZ))
    kernel = np.ones(window) / window
    middle = paths.mean(1)
    smooth = np.stack([np.convolve(middle[:, axis], kernel, "valid") for axis in range(3)], 1)
    velocity = np.gradient(smooth, 1 / _RATE_HZ, axis=0)[:, [0, 2]]
    speed = np.linalg.norm(velocity, axis=1)
    walking = speed > _WALKING_M_S
    if walking.sum() < _RATE_HZ:
        unknown = np.full(len(height), np.nan)
        return height, unknown, unknown, False
    inner = paths[(window - 1) // 2 :][: len(smooth)]
    # With Y up, left of the horizontal direction (x, z) is (z, -x).
    left = np.stack([velocity[:, 1], -velocity[:, 0]], 1)[walking] / speed[walking, None]
    beside = inner[walking][:, :, [0, 2]] - smooth[walking][:, None, [0, 2]]
    side = np.einsum("tnk,tk->tn", beside, left).mean(0)
    against = np.gradient(inner - smooth[:, None], 1 / _RATE_HZ, axis=0)[walking]
    swing = np.linalg.norm(against, axis=-1).mean(0) / speed[walking].mean()
    return height, side, swing, True
