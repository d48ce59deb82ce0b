"""Smooth curves over time: steps without corners, control points, natural variation."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

Array = NDArray[np.float64]


def smooth_step(x: Array) -> Array:
    """0 below 0, 1 above 1, the minimum-jerk quintic of Flash and Hogan (1985) between: smooth up to acceleration."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


def bump(x: Array) -> Array:
    """0 outside 0..1, 1 in its middle, smooth up to the second derivative."""
    x = np.clip(x, 0.0, 1.0)
    return (4.0 * x * (1.0 - x)) ** 3


def ramp(times: Array, start: float, end: float) -> Array:
    """0 before `start`, 1 after `end` seconds."""
    return smooth_step((times - start) / max(end - start, 1e-6))


def window(times: Array, start: float, end: float, fade: float) -> Array:
    """1 from `start` to `end` seconds, 0 further than `fade` seconds outside."""
    return ramp(times, start - fade, start) * (1.0 - ramp(times, end, end + fade))


def keyed(times: Array, key_times: Array, values: Array, softness: float = 0.04) -> Array:
    """A curve through control points that never overshoots them, its corners rounded over `softness` seconds.

    times: (T,) evenly spaced seconds; key_times: (K,) increasing seconds; values: (K, ...). Returns (T, ...).
    """
    curve = PchipInterpolator(key_times, values, axis=0)(np.clip(times, key_times[0], key_times[-1]))
    return gaussian_filter1d(curve, softness / (times[1] - times[0]), axis=0, mode="nearest")


def wander(rng: np.random.Generator, times: Array, amplitude: float, fastest: float = 0.5) -> Array:
    """(T,) a slow natural drift with standard deviation `amplitude`, made of sines between 0.05 and `fastest` Hz."""
    frequencies = rng.uniform(0.05, fastest, 5)
    phases = rng.uniform(0.0, 2 * np.pi, 5)
    return amplitude * np.sqrt(2 / 5) * np.sin(2 * np.pi * times[:, None] * frequencies + phases).sum(1)


def smooth_cover(needed: Array, reach: int) -> Array:
    """(T,) a smooth curve that is nowhere below `needed`: widened by `reach` frames, then blurred."""
    return gaussian_filter1d(maximum_filter1d(needed, 2 * reach + 1), reach / 3.0, radius=reach, mode="nearest")
