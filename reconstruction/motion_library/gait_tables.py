"""Published gait curves and laws as data: joint angles over the cycle, cadence, stance, sway, pelvis and arms.

Phase runs from one heel strike (0) to the next of the same foot (1). Curves are control points in degrees; they are
interpolated periodically without overshoot. Signs: hip flexion, knee flexion, toes above heel, arm forward positive.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]

GRAVITY = 9.81
WALK_STANCE = 0.62
"""Share of the walking cycle in stance at a natural speed (Perry and Burnfield 2010)."""
RUN_STANCE = 0.36
"""Share of the running cycle in stance at about 3.2 m/s (Novacheck 1998, The biomechanics of running)."""
RUN_SPEED = 2.05
"""m/s at which adults of 1.70 m break into a run (Hreljac 1993)."""

_SAMPLES = 2048

CURVES: dict[str, tuple[tuple[float, float], ...]] = {
    # Winter 1991, Biomechanics and Motor Control of Human Gait, natural cadence; thigh against the vertical.
    "walk_hip": (
        (0.00, 24),
        (0.12, 20),
        (0.31, 1),
        (0.50, -17),
        (0.56, -14),
        (0.62, -4),
        (0.72, 14),
        (0.82, 24),
        (0.90, 26),
    ),
    "walk_knee": ((0.00, 5), (0.14, 18), (0.40, 5), (0.50, 11), (0.62, 40), (0.72, 64), (0.84, 38), (0.95, 5)),
    # The foot against the floor: heel, ankle and forefoot rockers of Perry; lift-off near 60 degrees (Winter 1991).
    "walk_foot": (
        (0.00, 20),
        (0.04, 12),
        (0.09, 0),
        (0.34, 0),
        (0.42, -9),
        (0.50, -24),
        (0.56, -40),
        (0.62, -57),
        (0.66, -62),
        (0.75, -38),
        (0.84, -6),
        (0.93, 16),
        (0.97, 21),
    ),
    # Novacheck 1998, running at about 3.2 m/s.
    "run_hip": (
        (0.00, 33),
        (0.10, 24),
        (0.20, 6),
        (0.36, -18),
        (0.42, -16),
        (0.55, 12),
        (0.72, 46),
        (0.82, 50),
        (0.94, 38),
    ),
    "run_knee": (
        (0.00, 18),
        (0.14, 43),
        (0.32, 24),
        (0.38, 26),
        (0.50, 74),
        (0.62, 98),
        (0.74, 86),
        (0.88, 34),
        (0.96, 16),
    ),
    "run_foot": (
        (0.00, 10),
        (0.05, 0),
        (0.17, 0),
        (0.25, -22),
        (0.32, -46),
        (0.36, -58),
        (0.44, -80),
        (0.56, -82),
        (0.68, -52),
        (0.80, -22),
        (0.92, 8),
        (0.97, 12),
    ),
    # Murray, Sepic and Barnard 1967, Patterns of sagittal rotation of the upper limbs in walking; the elbow trails.
    "walk_shoulder": ((0.02, -24), (0.25, -8), (0.50, 10), (0.55, 10), (0.78, -8), (0.98, -24)),
    "walk_elbow": ((0.05, 18), (0.30, 24), (0.54, 38), (0.80, 26)),
    # Hinrichs 1987, Upper extremity function in running: about a right angle at the elbow.
    "run_shoulder": ((0.04, -48), (0.20, -30), (0.46, 16), (0.58, 14), (0.84, -36)),
    "run_elbow": ((0.06, 96), (0.30, 82), (0.54, 104), (0.80, 84)),
    # Pelvis: Kadaba, Ramakrishnan and Wootten 1990. List: the swing side drops early. Rotation: forward side leads.
    "pelvis_list": ((0.00, 0), (0.14, 4), (0.30, 1.5), (0.50, 0), (0.64, -4), (0.80, -1.5)),
    "pelvis_rotation": ((0.00, -5), (0.06, -4.8), (0.31, 0), (0.50, 5), (0.56, 4.8), (0.81, 0)),
}


@lru_cache(maxsize=32)
def _table(name: str) -> Array:
    keys = np.array(CURVES[name])
    phase = np.concatenate([keys[:, 0] - 1, keys[:, 0], keys[:, 0] + 1])
    grid = np.arange(_SAMPLES) / _SAMPLES
    values = PchipInterpolator(phase, np.tile(keys[:, 1], 3))(grid)
    return np.radians(gaussian_filter1d(values, 0.012 * _SAMPLES, mode="wrap"))


def curve(name: str, phase: Array) -> Array:
    """Radians of the named curve at phases of any size (...)."""
    table = _table(name)
    position = np.mod(phase, 1.0) * _SAMPLES
    below = position.astype(int) % _SAMPLES
    return table[below] + (position - np.floor(position)) * (table[(below + 1) % _SAMPLES] - table[below])


def at_stance(phase: Array, stance: Array, published: float) -> Array:
    """The phase of a published curve, whose stance ends at `published`, for a cycle whose stance ends at `stance`."""
    return phase + (published - stance) * np.sin(np.pi * phase) ** 2 / np.sin(np.pi * stance) ** 2


def walking_cadence(speed: Array, stature: float) -> Array:
    """Steps a second at a speed (m/s): the walk ratio of step length to cadence stays at 0.0064 m min (Sekiya 1996).

    Statures other than 1.70 m follow by dynamic similarity (equal Froude number).
    """
    ratio = 0.0064 * (stature / 1.70) ** 1.5
    return np.sqrt(np.maximum(speed, 0.0) / (60.0 * ratio))


def running_cadence(speed: Array, stature: float) -> Array:
    """Steps a second at a speed (m/s): nearly constant, growing slowly (Cavanagh and Kram 1990)."""
    return (2.62 + 0.13 * (speed - 2.2)) * np.sqrt(1.70 / stature)


def walking_stance(speed: Array) -> Array:
    """Share of the cycle in stance: 0.66 slow to 0.58 fast (Murray 1984, fitted by a line)."""
    return np.clip(0.69 - 0.05 * speed, 0.57, 0.67)


def running_stance(speed: Array) -> Array:
    """Share of the cycle in stance: 0.42 jogging to 0.28 fast (Minetti 1998, fitted by a line)."""
    return np.clip(0.36 - 0.045 * (speed - 3.2), 0.26, 0.43)


def vertical_excursion(speed: Array, stature: float) -> Array:
    """Metres peak to peak of the walking pelvis: 27 mm at 0.7 m/s, 48 mm at 1.6 m/s (Orendurff et al. 2004)."""
    return np.clip(0.0274 + 0.0232 * (speed - 0.7), 0.0, 0.065) * stature / 1.70


def lateral_excursion(speed: Array, stature: float) -> Array:
    """Metres peak to peak of the walking pelvis: 70 mm at 0.7 m/s, 39 mm at 1.6 m/s (Orendurff et al. 2004)."""
    return np.clip(0.0699 - 0.0349 * (speed - 0.7), 0.025, 0.075) * stature / 1.70


def running_height(step_phase: Array, contact_share: Array, step_time: Array) -> Array:
    """Metres of the running centre of mass above its height at touch-down.

    The vertical force is half a sine in stance and nothing in flight (Alexander 1989), which fixes the rest: a
    parabola under gravity in flight. step_phase: 0 at touch-down to 1 at the next; contact_share: its part on the
    floor; step_time: seconds.
    """
    contact = contact_share * step_time
    flight = step_time - contact
    time = np.mod(step_phase, 1.0) * step_time
    on_floor = GRAVITY * time * (contact - time) / 2 - GRAVITY * step_time * contact / (2 * np.pi) * np.sin(
        np.pi * np.minimum(time / contact, 1.0)
    )
    in_air = time - contact
    return np.where(time < contact, on_floor, GRAVITY * in_air * (flight - in_air) / 2)
