"""Whether a calibration can be relied on, and what would make it better, in words for the person who wears it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES
from reconstruction.body_fit import Fit
from reconstruction.pose_space import ROOT_DOF, PoseSpace
from reconstruction.slipping import Slip


class Grade(Enum):
    """How good a calibration is."""

    GOOD = "good"
    USABLE = "usable"
    POOR = "poor"


@dataclass(frozen=True)
class Judgement:
    """grade and verdict: the whole in a word and in a line; advice: a line for each thing to do better."""

    grade: Grade
    verdict: str
    advice: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is judged. height_m: stature that came out; deviations_cm: see `CalibrationResult`; roles: seen;
    swapped: two roles whose trackers fit better the other way round, or None; moments: of free movement, the last of
    the fit's; held: whether a T-pose was seen; slip: of a tracker, in seconds since the first frame, or None."""

    fit: Fit
    space: PoseSpace
    height_m: float
    deviations_cm: Mapping[str, float]
    roles: Sequence[str]
    swapped: tuple[str, ...]
    moments: int
    held: bool
    slip: Slip | None = None


STRANGE = 2.0
"""Surprise from which on a tracker does not move as its joint does; 1 is as expected."""
IMPLAUSIBLE = 0.18
"""Share by which a segment differs from usual proportions in one of 700 adults: three standard deviations."""
FAR_OFFSET_M = 0.14
UNSURE_CM = 3.5
"""A length or offset that is known no better is worth a warning."""
_LEAST_BEND = {"lower_arm": 12.0, "lower_leg": 10.0}
"""Degrees (root mean square about its mean) that an elbow and a knee should move by at least."""
_BEND = {"lower_arm": "bend and stretch your {side} elbow", "lower_leg": "lift and bend your {side} knee"}
_WORDS = {"lower_arm": "wrist", "lower_leg": "ankle"}


def judged(evidence: Evidence) -> Judgement:
    """Grade, verdict and advice."""
    wrong, better = _wrong(evidence), _better(evidence)
    tall = f"{evidence.height_m:.2f} m tall"
    if wrong:
        return Judgement(Grade.POOR, f"poor: {wrong[0]}", (*wrong[1:], *better))
    if better:
        return Judgement(Grade.USABLE, f"usable: {tall}; it would gain if you {better[0]}", tuple(better))
    worst = max(evidence.deviations_cm[role] for role in evidence.roles)
    return Judgement(Grade.GOOD, f"good: {tall}, every tracker's place known to {worst:.1f} cm", ())


def _wrong(e: Evidence) -> list[str]:
    """What makes the result unreliable."""
    found = []
    if e.swapped:
        found.append(f"{' and '.join(map(named, e.swapped))} look swapped: change them round and calibrate again")
    if e.slip is not None:
        found.append(
            f"the {named(e.slip.role)}'s tracker moved about {100 * e.slip.metres:.0f} cm on its strap at "
            f"about {e.slip.time_s:.0f} s: fasten it and calibrate again"
        )
    if not 1.0 <= e.height_m <= 2.3:
        found.append(f"a height of {e.height_m:.2f} m came out: check the device's units and the floor's height")
    for name, scale in e.fit.scales.items():
        if name != "stature" and abs(scale - 1) > IMPLAUSIBLE:
            found.append(
                f"your {name} came out {100 * abs(scale - 1):.0f} % {'longer' if scale > 1 else 'shorter'} than usual:"
                " check that every tracker is on its own limb"
            )
    offsets = np.linalg.norm(e.fit.mounting.offsets, axis=1)
    for role, off, odd in zip(ROLES, offsets, _surprise(e), strict=True):
        if role in e.roles and off > FAR_OFFSET_M:
            found.append(
                f"the tracker of the {named(role)} came out {100 * off:.0f} cm from its joint: is it in place?"
            )
        if role in e.roles and odd > STRANGE:
            found.append(f"the tracker of the {named(role)} does not move as it should: has it slipped or lost sight?")
    return found


def _better(e: Evidence) -> list[str]:
    """What the performer could do for a better result, each going with "if you ..."."""
    found = []
    if not e.held:
        found.append("hold a T-pose for three seconds, arms out to the sides")
    if not e.moments:
        return [*found, "move freely for ten seconds after it"]
    bends = {bone: _bend_deg(e, bone) for part in _BEND for bone in (f"left_{part}", f"right_{part}")}
    for bone, degrees in bends.items():
        side, _, part = bone.partition("_")
        if f"{side}_{_WORDS[part]}" in e.roles and degrees < _LEAST_BEND[part]:
            found.append(_BEND[part].format(side=side))
    for role in e.roles:
        if e.deviations_cm[role] > UNSURE_CM and not found:
            found.append(f"move your {named(role)} in more ways")
    return found


def _surprise(e: Evidence) -> NDArray[np.float64]:
    """(6,) median over the moments of free movement; NaN where the role is missing."""
    out = np.full(len(ROLES), np.nan)
    seen = e.fit.surprise[len(e.fit.surprise) - e.moments :]
    for role in range(len(ROLES)):
        there = seen[np.isfinite(seen[:, role]), role]
        if len(there):
            out[role] = np.median(there)
    return out


def _bend_deg(e: Evidence, bone: str) -> float:
    """Degrees, root mean square by which a joint moves about its mean; infinite for one that the body lacks."""
    joint = e.space.skeleton.humanoid.get(bone)
    place = np.flatnonzero(e.space.moving == joint)
    if not len(place):
        return np.inf
    first = ROOT_DOF + 3 * int(place[0])
    turns = e.fit.poses[len(e.fit.poses) - e.moments :, first : first + 3]
    return float(np.degrees(np.sqrt(np.sum(np.var(turns, axis=0)))))


def named(role: str) -> str:
    """`left wrist`."""
    return role.replace("_", " ")
