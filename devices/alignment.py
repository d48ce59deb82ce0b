"""Where a second device stands: found by waving one tracker of each together."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.clock_map import ClockMap
from devices.errors import DeviceError
from devices.room import RoomTransform
from devices.sample import SampleFlag, TrackerSample

_LEAST_MOMENTS = 30
_LEAST_SPREAD_M = 0.05
_LONGEST_GAP_S = 0.1
_TRIM = 3.0


@dataclass(frozen=True, eq=False, slots=True)
class TrackerPath:
    """Where a tracker was. times: (N,) seconds on the host's clock, rising; positions: (N, 3) metres."""

    times: NDArray[np.float64]
    positions: NDArray[np.float64]


def tracker_path(samples: Iterable[TrackerSample], tracker: str) -> TrackerPath:
    """The path of one tracker in a device's samples, by its own clock where it has one."""
    clock = ClockMap()
    times, positions = [], []
    for sample in samples:
        time_ns = sample.host_time_ns
        if sample.device_time_s is not None:
            time_ns = clock.host_ns(sample.device_time_s, time_ns)
        if sample.tracker == tracker and sample.position is not None and not sample.flags & SampleFlag.HELD:
            times.append(time_ns * 1e-9)
            positions.append(sample.position)
    return TrackerPath(np.array(times), np.array(positions).reshape(-1, 3))


@dataclass(frozen=True, slots=True)
class RoomAlignment:
    """room: `T_world_device` of the second device. residual_m: root mean square distance that remains between the two
    trackers; the distance at which they were held from each other is in it. used: share of moments not set aside."""

    room: RoomTransform
    residual_m: float
    used: float


def align(first: TrackerPath, second: TrackerPath) -> RoomAlignment:
    """The rigid transform that carries the second tracker's path onto the first's, which is in the world.

    Least squares (Arun, Huang and Blostein 1987; the reflection case after Umeyama 1991), then again without the
    moments whose distance is beyond three times the median. Raises DeviceError where the wave says too little: too
    short, or along a line only.
    """
    inside, moments = _together(first, second)
    if len(moments) < _LEAST_MOMENTS:
        raise DeviceError("the two trackers were not both seen for long enough: wave them together for 5 seconds")
    spread = np.linalg.svd(moments - moments.mean(0), compute_uv=False) / np.sqrt(len(moments))
    if spread[1] < _LEAST_SPREAD_M:
        raise DeviceError(
            f"the wave is a line (only {spread[1] * 100:.0f} cm across it): draw large circles in all directions"
        )
    rotation, translation = _rigid(inside, moments)
    for _ in range(2):
        keep = _near(inside @ rotation.T + translation, moments)
        rotation, translation = _rigid(inside[keep], moments[keep])
    placed = inside @ rotation.T + translation
    keep = _near(placed, moments)
    distance = np.linalg.norm(placed - moments, axis=1)
    quaternion = tuple(Rotation.from_matrix(rotation).as_quat().tolist())
    residual = float(np.sqrt((distance[keep] ** 2).mean()))
    return RoomAlignment(RoomTransform(quaternion, tuple(translation.tolist())), residual, float(keep.mean()))


def _near(placed: NDArray[np.float64], moments: NDArray[np.float64]) -> NDArray[np.bool_]:
    distance = np.linalg.norm(placed - moments, axis=1)
    return distance <= max(_TRIM * float(np.median(distance)), 1e-6)


def _together(first: TrackerPath, second: TrackerPath) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(M, 3) places of the second tracker and of the first at the second's times, where both were seen."""
    if len(first.times) < 2:
        return np.empty((0, 3)), np.empty((0, 3))
    after = np.clip(np.searchsorted(first.times, second.times), 1, len(first.times) - 1)
    gap = first.times[after] - first.times[after - 1]
    both = (second.times >= first.times[0]) & (second.times <= first.times[-1]) & (gap <= _LONGEST_GAP_S)
    there = np.stack([np.interp(second.times, first.times, first.positions[:, axis]) for axis in range(3)], 1)
    return second.positions[both], there[both]


def _rigid(source: NDArray[np.float64], target: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """R (3, 3) and t (3,) that minimise |R source + t - target|."""
    middle, goal = source.mean(0), target.mean(0)
    u, _, vt = np.linalg.svd((target - goal).T @ (source - middle))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return rotation, goal - rotation @ middle
