"""What a simulated device measures: tracker positions of a motion at the device's rate, with a tracker's faults."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.sample import TrackerSample

_LONGEST_DROPOUT_S = 0.5


@dataclass(frozen=True)
class SimulatedMotion:
    """Where the trackers are over time.

    positions: (T, R, 3) metres, Y up; NaN where a tracker is not seen.
    fps: rows a second.
    orientations: (T, R, 4) unit quaternions (x, y, z, w), or None for a device that tells the identity.
    """

    positions: NDArray[np.float64]
    fps: float
    orientations: NDArray[np.float64] | None = None

    @property
    def duration_s(self) -> float:
        """Seconds from the first row to the last."""
        return (len(self.positions) - 1) / self.fps


@dataclass(frozen=True, slots=True)
class Faults:
    """What goes wrong with the measurements.

    noise_m: standard deviation on each axis. dropout: share of the time that a tracker is not seen, in stretches of up
    to half a second. clock_drift: how much faster the device's clock runs (1e-4 is 100 ppm).
    """

    noise_m: float = 0.0
    dropout: float = 0.0
    clock_drift: float = 0.0
    seed: int = 0


def measurements(
    motion: SimulatedMotion, rate_hz: float, faults: Faults | None = None, loop: bool = False
) -> Iterator[tuple[float, list[TrackerSample]]]:
    """(seconds since start, one sample a tracker) at the device's rate, trackers named "1", "2", ...

    Positions are interpolated between rows. With `loop` the motion plays forwards and backwards without end.
    """
    faults = faults or Faults()
    rng = np.random.default_rng(faults.seed)
    hidden = np.zeros(motion.positions.shape[1])
    tick = 0
    while loop or tick / rate_hz <= motion.duration_s + 1e-9:
        time_s = tick / rate_hz
        positions, orientations = _at(motion, time_s)
        positions = positions + rng.normal(0.0, faults.noise_m, positions.shape)
        hidden = _hidden(hidden, faults.dropout, rate_hz, rng)
        yield (
            time_s,
            [
                _sample(i, position, orientations[i], time_s * (1 + faults.clock_drift), bool(hidden[i] > 0))
                for i, position in enumerate(positions)
            ],
        )
        tick += 1


def _at(motion: SimulatedMotion, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    last = len(motion.positions) - 1
    place = time_s * motion.fps
    if last:
        place = last - abs(place % (2 * last) - last)
    row = min(int(place), max(last - 1, 0))
    share = place - row
    after = min(row + 1, last)
    positions = motion.positions[row] if share < 1e-9 else _mix(motion.positions[row], motion.positions[after], share)
    if motion.orientations is None:
        return positions, np.tile([0.0, 0.0, 0.0, 1.0], (len(positions), 1))
    a, b = motion.orientations[row], motion.orientations[after]
    mixed = _mix(a, np.where((a * b).sum(1, keepdims=True) < 0, -b, b), share)
    return positions, mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def _mix(a: NDArray[np.float64], b: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    return a + share * (b - a)


def _hidden(
    seconds_left: NDArray[np.float64], share: float, rate_hz: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """How much longer each tracker stays hidden; in the long run `share` of the time."""
    left = np.maximum(seconds_left - 1 / rate_hz, 0.0)
    if share <= 0:
        return left
    mean_hidden_s, mean_seen_s = _LONGEST_DROPOUT_S / 2, _LONGEST_DROPOUT_S / 2 * (1 - share) / share
    falls = (left <= 0) & (rng.random(len(left)) < min(1.0, 1 / max(rate_hz * mean_seen_s, 1e-9)))
    return np.where(falls, rng.uniform(0.0, 2 * mean_hidden_s, len(left)) + 1 / rate_hz, left)


def _sample(
    index: int, position: NDArray[np.float64], orientation: NDArray[np.float64], device_time_s: float, hidden: bool
) -> TrackerSample:
    seen = not hidden and bool(np.isfinite(position).all())
    x, y, z = position.tolist()
    qx, qy, qz, qw = orientation.tolist()
    return TrackerSample(
        str(index + 1),
        0,
        (x, y, z) if seen else None,
        (qx, qy, qz, qw) if seen and np.isfinite(orientation).all() else None,
        device_time_s,
        quality=0.95 if seen else 0.0,
        battery=0.8,
    )
