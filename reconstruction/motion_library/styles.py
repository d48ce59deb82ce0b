"""How a person moves, apart from what they do: carriage, vigour and proportions of the gait."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator


@dataclass(frozen=True)
class Style:
    """Factors (1 is natural) and angles (degrees, 0 is natural) that shape every action.

    cadence, bounce, sway, arm_swing, pelvis, foot: factors on steps a second, rise and fall, side to side, arms, pelvis
    turns and foot roll. lean, neck: trunk and head forward. abduct, elbow, shoulders: arms outward, more bent, raised.
    sink: the pelvis lower, as a share of stature. knee_lift: degrees of hip and knee added in swing. width: of steps.
    head_sway: how lively the head is. flare: toes outward.
    """

    cadence: float = 1.0
    bounce: float = 1.0
    sway: float = 1.0
    arm_swing: float = 1.0
    pelvis: float = 1.0
    foot: float = 1.0
    width: float = 1.0
    lean: float = 0.0
    neck: float = 0.0
    abduct: float = 0.0
    elbow: float = 0.0
    arm_forward: float = 0.0
    shoulders: float = 0.0
    sink: float = 0.0
    knee_lift: float = 0.0
    head_sway: float = 1.0
    flare: float = 8.0
    asymmetry: float = 0.0


STYLES: dict[str, Style] = {
    "neutral": Style(),
    "relaxed": Style(cadence=0.96, sway=1.2, arm_swing=1.15, pelvis=1.2, lean=2, flare=11),
    "happy": Style(
        cadence=1.05, bounce=1.35, arm_swing=1.45, pelvis=1.3, lean=-2, neck=-4, abduct=5, elbow=12, head_sway=1.6
    ),
    "tired": Style(
        cadence=0.90, bounce=0.75, sway=1.4, arm_swing=0.55, foot=0.65, lean=11, neck=16, sink=0.012, flare=12
    ),
    "stiff": Style(bounce=0.6, sway=0.7, arm_swing=0.25, pelvis=0.25, foot=0.8, abduct=5, shoulders=4, head_sway=0.3),
    "proud": Style(cadence=0.97, arm_swing=1.1, lean=-4, neck=-5, abduct=8, elbow=6, flare=14, width=1.15),
    "sneaky": Style(
        cadence=0.85,
        bounce=0.7,
        arm_swing=0.5,
        foot=0.6,
        lean=20,
        neck=-14,
        abduct=12,
        elbow=55,
        arm_forward=18,
        sink=0.055,
        knee_lift=16,
        head_sway=1.8,
        width=1.2,
    ),
    "angry": Style(cadence=1.06, bounce=1.1, sway=0.8, arm_swing=1.1, lean=8, neck=5, abduct=11, elbow=22, shoulders=6),
    "march": Style(bounce=1.15, sway=0.7, arm_swing=1.8, pelvis=0.7, lean=-2, neck=-3, elbow=-8, knee_lift=20, flare=5),
    "old": Style(
        cadence=1.12,
        bounce=0.6,
        sway=1.1,
        arm_swing=0.6,
        foot=0.5,
        lean=18,
        neck=-6,
        elbow=25,
        sink=0.025,
        width=1.4,
        flare=14,
    ),
}
"""Kinematic cues of mood and age: Montepare, Goldstein and Clausen (1987); Roether et al. (2009); Winter (1991)."""


def personal(style: Style, rng: Generator) -> Style:
    """The style as one person has it: every factor a few per cent and every angle a few degrees off."""
    factors = {
        name: getattr(style, name) * float(np.clip(rng.normal(1.0, 0.10), 0.75, 1.25))
        for name in ("bounce", "sway", "arm_swing", "pelvis", "width", "head_sway")
    }
    angles = {
        name: getattr(style, name) + float(np.clip(rng.normal(), -2, 2)) * spread
        for name, spread in (
            ("lean", 2.0),
            ("neck", 3.0),
            ("abduct", 2.0),
            ("elbow", 5.0),
            ("flare", 3.0),
            ("asymmetry", 1.5),
        )
    }
    cadence = style.cadence * float(np.clip(rng.normal(1.0, 0.03), 0.94, 1.06))
    foot = style.foot * float(rng.uniform(0.9, 1.05))
    return replace(style, cadence=cadence, foot=foot, **factors, **angles)
