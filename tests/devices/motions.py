"""Smooth tracker motions of our own for simulated devices."""

import numpy as np

from devices.simulators.source import SimulatedMotion


def waving(trackers: int, seconds: float, fps: float = 60.0) -> SimulatedMotion:
    """Trackers on slow circles of different sizes, 1 m above the ground and in front of any device."""
    t = np.arange(round(seconds * fps) + 1)[:, None] / fps
    phase = np.arange(trackers)[None]
    x, y, z = 0.3 * np.sin(t + phase), 1.0 + 0.2 * np.cos(1.3 * t + phase), -0.4 + 0.1 * np.sin(2 * t)
    positions = np.stack(np.broadcast_arrays(x, y, z), -1)
    half = 0.2 * np.sin(t + phase)
    turned = np.stack(np.broadcast_arrays(0 * half, np.sin(half), 0 * half, np.cos(half)), -1)
    return SimulatedMotion(positions, fps, turned)
