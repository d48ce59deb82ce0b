"""A person's joints, from where limbs meet, bend and narrow, and from a body's proportions where nothing shows."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from deformation.auto_rig_extremities import Extremities
from deformation.curve_skeleton import MINIMAL_BEND, CentreLine, outward, sharpest_bend
from deformation.isocurves_geodesic import level_rings, peaks
from deformation.rig_templates import HUMAN, HumanTemplate
from devices.errors import SixpointError

Joints = dict[str, NDArray[np.float64]]

_NARROWEST_TO_WRIST = 0.012
"""The forearm is narrowest that share of stature above the wrist's joint."""

_HIND_FOOT = 0.04
"""Along the surface the heel is so near to the longest ring around the foot, as a share of stature; toes are not."""

_CLEAR_BEND = 2 * MINIMAL_BEND
"""An elbow or knee that bends so far is where it bends, whatever proportion says."""

_WIDENED = 1.2
"""Where the neck's rings are longer than the shortest by so much it goes over into the shoulders."""

_PALM = 0.6
"""Fingers have shorter rings than that share of the longest on hand and forearm; the palm has longer ones."""

_PALM_LENGTH = 0.12
"""The palm's longest ring lies so near to the fingers, as a share of the arm."""

_NARROWEST_TO_KNEE = 0.012
"""The leg is narrowest that share of stature under the knee's joint."""

_ARMPIT_MOVES = 0.03
"""The most that an arm's usual length may shift its shoulder joint, as a share of stature."""

_SHOULDER_OVER_ARMPIT = 0.076
"""The shoulder joint's greatest height over the armpit as a share of stature."""


def human_joints(
    body: Extremities, line_of: Callable[[str, float], CentreLine], template: HumanTemplate = HUMAN
) -> Joints:
    """Joint places (3,) metres by name, every joint of `rig_templates.HUMAN_TREE`.

    line_of: the centre line of a tip's limb up to a distance in metres from it along the surface.
    Raises SixpointError where legs or arms are not parted from the body.
    """
    at = seams(body)
    joints: Joints = {}
    for side in ("left", "right"):
        joints |= _arm(body, side, at[f"{side}_hand"], line_of, template)
    shoulder_height = float(np.mean([joints[f"{side}_upper_arm"][1] for side in ("left", "right")]))
    hip_height = _hip_height(body, at["crotch"], shoulder_height, template)
    for side in ("left", "right"):
        joints |= _leg(body, side, at["crotch"], hip_height, line_of, template)
    return joints | _trunk(body, joints, line_of, template)


def seams(body: Extremities) -> Joints:
    """(3,) where the limbs part, seen from the head: the crotch, and the armpit by hand.

    Raises SixpointError where legs or arms are not parted from the body.
    """
    graph, field = body.graph, body.fields["head"]
    found = peaks(graph, field, 0.03 * float(field.max()))
    places: Joints = {}
    for name in ("left_hand", "right_hand", "left_foot", "right_foot"):
        near = np.flatnonzero(body.fields[name][found.tops] < 0.15 * body.height)
        if not len(near):
            raise SixpointError(f"the {name.replace('_', ' ')} does not stand clear of the body: part the limbs")
        peak = int(near[0])
        if found.saddles[peak] >= 0:
            places[name] = graph.vertices[found.saddles[peak]]
    crotch = [places.pop(name) for name in ("left_foot", "right_foot") if name in places]
    if not crotch or "left_hand" not in places or "right_hand" not in places:
        raise SixpointError("the legs or the arms are not parted from the body: no crotch or armpit is found")
    lowest = min(crotch, key=lambda place: float(place[1]))
    return places | {"crotch": lowest} | _as_wide(places["left_hand"], places["right_hand"], lowest)


def _as_wide(left: NDArray[np.float64], right: NDArray[np.float64], crotch: NDArray[np.float64]) -> Joints:
    """Both armpits equally far from the middle: on coarse meshes a seam is known to a vertex or two only."""
    half = (left[0] - right[0]) / 2
    middle = (crotch[0] + (left[0] + right[0]) / 2) / 2
    return {
        "left_hand": np.array([middle + half, *left[1:]]),
        "right_hand": np.array([middle - half, *right[1:]]),
    }


def _arm(
    body: Extremities,
    side: str,
    armpit: NDArray[np.float64],
    line_of: Callable[[str, float], CentreLine],
    template: HumanTemplate,
) -> Joints:
    stature, name = body.height, f"{side}_hand"
    reach = float(body.fields[name][_vertex_at(body, armpit)])
    line = line_of(name, reach)
    shoulder = _above_armpit(body, line, reach, armpit, template)
    whole = float(np.linalg.norm(shoulder - line.at(0.75 * line.length))) + 0.75 * line.length
    web = line.widens(_PALM, 0.38 * whole)
    palm = line.widest(web, web + _PALM_LENGTH * whole)
    narrow = line.narrowest(max(palm, 0.15 * whole), 0.38 * whole) - _NARROWEST_TO_WRIST * stature
    wrist_arc = (narrow + template.hand * whole) / 2
    upper = line.between(wrist_arc, max(0.85 * line.length, line.nearest_arc(shoulder)))
    elbow = _middle_joint(line, wrist_arc, whole, 1 - template.elbow, upper, 0.0)
    return {
        f"{side}_upper_arm": shoulder,
        f"{side}_lower_arm": elbow,
        f"{side}_hand": line.at(wrist_arc),
        f"{side}_hand_end": body.place(name),
    }


def _above_armpit(
    body: Extremities, line: CentreLine, reach: float, armpit: NDArray[np.float64], template: HumanTemplate
) -> NDArray[np.float64]:
    """The upper arm's axis continued to the sagittal plane through the armpit, or nearer to an arm's usual length.

    The armpit's fold moves as the arm is raised, by up to a hand's breadth; the arm's length does not.
    """
    middle, direction = line.axis(0.74 * reach, 0.92 * reach)
    across = direction[0]
    step = (armpit[0] - middle[0]) / across if abs(across) > 0.2 else np.inf
    top = armpit[1] + _SHOULDER_OVER_ARMPIT * body.height
    if middle[1] + step * direction[1] > top or not np.isfinite(step):
        step = (top - middle[1]) / direction[1]
    place = middle + step * direction
    length = 0.75 * line.length + float(np.linalg.norm(place - line.at(0.75 * line.length)))
    most = _ARMPIT_MOVES * body.height
    return place - np.clip((template.arm * body.height - length) / 2, -most, most) * direction


def _middle_joint(
    line: CentreLine, end_arc: float, whole: float, share: float, span: CentreLine, above_waist: float
) -> NDArray[np.float64]:
    """Elbow or knee: midway of where proportion and the limb's waist put it, or nearer to its bend the sharper that is.

    end_arc: of the wrist or ankle; whole: arc of the shoulder or hip; share: of the way from the former to the latter.
    span: the line between these, as far as it goes; above_waist: metres from the narrowest place on to the joint.
    """
    arc, bend = sharpest_bend(span)
    expected = end_arc + share * (whole - end_arc)
    margin = 0.16 * (whole - end_arc)
    waist = line.waist(expected - margin, expected + margin)
    usual = expected if waist is None else (expected + waist + above_waist) / 2
    if bend < MINIMAL_BEND or abs(end_arc + arc - expected) > 0.2 * (whole - end_arc):
        return line.at(usual)
    trust = min((bend - MINIMAL_BEND) / (_CLEAR_BEND - MINIMAL_BEND), 1.0)
    return line.at(trust * (end_arc + arc) + (1 - trust) * usual) + outward(span, arc)


def _hip_height(
    body: Extremities, crotch: NDArray[np.float64], shoulder_height: float, template: HumanTemplate
) -> float:
    """The middle one of three estimates, so that a big head or long legs cannot mislead it."""
    floor = float(body.graph.vertices[:, 1].min())
    between = crotch[1] + template.hip_between * (shoulder_height - crotch[1])
    by_shoulder = floor + template.hip_to_shoulder * (shoulder_height - floor)
    by_stature = floor + template.hip_to_stature * body.height
    return float(np.median([between, by_shoulder, by_stature]))


def _leg(
    body: Extremities,
    side: str,
    crotch: NDArray[np.float64],
    hip_height: float,
    line_of: Callable[[str, float], CentreLine],
    template: HumanTemplate,
) -> Joints:
    name = f"{side}_foot"
    reach = float(body.fields[name][_vertex_at(body, crotch)])
    line = line_of(name, reach)
    ankle = _ankle(body, name, line, reach, template)
    middle, direction = line.axis(0.72 * reach, 0.94 * reach)
    hip = middle + (hip_height - middle[1]) / direction[1] * direction
    hip[2] = (hip[2] + trunk_middle(body, hip_height)[2]) / 2
    ankle_arc = line.nearest_arc(ankle)
    whole = 0.75 * line.length + float(np.linalg.norm(hip - line.at(0.75 * line.length)))
    below = _NARROWEST_TO_KNEE * body.height
    knee = _middle_joint(line, ankle_arc, whole, 1 - template.knee, line.between(ankle_arc, line.length), below)
    tip = body.place(name)
    ball_arc = (1 - template.toes) * _across(tip - ankle, line.axis(0.36 * reach, 0.52 * reach)[1])
    return {
        f"{side}_upper_leg": hip,
        f"{side}_lower_leg": knee,
        f"{side}_foot": ankle,
        f"{side}_toes": line.at(ball_arc),
        f"{side}_toes_end": tip,
    }


def _ankle(
    body: Extremities, name: str, line: CentreLine, reach: float, template: HumanTemplate
) -> NDArray[np.float64]:
    """On the shank's axis, midway of a body's usual ankle height and that of the ring around heel and instep.

    Heights are along that axis, from the heel's lowest point on, so that the foot may stand on its toes or hang.
    """
    field = body.fields[name]
    foot = level_rings(body.graph, field, np.linspace(0.1, 0.38, 28) * reach)
    widest = int(np.argmax(foot.girths))
    middle, direction = line.axis(0.36 * reach, 0.52 * reach)
    up = -direction
    hind = np.abs(field - foot.levels[widest]) < _HIND_FOOT * body.height
    sole = float((body.graph.vertices[hind] @ up).min())
    height = (float(foot.centres[widest] @ up) + sole + template.ankle_height * body.height) / 2
    return middle + (height - middle @ up) * up


def _across(offset: NDArray[np.float64], axis: NDArray[np.float64]) -> float:
    """Metres of an offset (3,) at right angles to a unit axis (3,)."""
    return float(np.linalg.norm(offset - (offset @ axis) * axis))


def trunk_middle(body: Extremities, height: float) -> NDArray[np.float64]:
    """(3,) metres: the middle of the level slice through the trunk at a height."""
    rings = level_rings(body.graph, body.graph.vertices[:, 1], np.array([height]))
    return rings.centres[0]


def _trunk(
    body: Extremities, limbs: Joints, line_of: Callable[[str, float], CentreLine], template: HumanTemplate
) -> Joints:
    """Hips, spine, neck and head along the middle of the trunk, collar bones beside it."""
    shoulders = (limbs["left_upper_arm"] + limbs["right_upper_arm"]) / 2
    hips = (limbs["left_upper_leg"] + limbs["right_upper_leg"]) / 2
    line = line_of("head", 0.3 * body.height)
    neck = _neck(body, line, shoulders, template)
    hips = hips + np.array([0, 0.04 * (neck[1] - hips[1]), 0])
    joints: Joints = {"hips": hips, "neck": neck}
    for name, share in zip(("spine", "chest", "upper_chest"), template.spine, strict=True):
        joints[name] = _on_trunk(body, hips, neck, share)
    crown = body.place("head")
    joints["head"] = neck + template.head * (crown - neck)
    joints["head_end"] = crown
    breast = np.array([shoulders[0], shoulders[1] + 0.007 * body.height, joints["upper_chest"][2]])
    for side in ("left", "right"):
        joints[f"{side}_shoulder"] = breast + template.clavicle * (limbs[f"{side}_upper_arm"] - breast)
    return joints


def _neck(
    body: Extremities, line: CentreLine, shoulders: NDArray[np.float64], template: HumanTemplate
) -> NDArray[np.float64]:
    """The middle one of three estimates of its height: by where the neck is slim, where it widens, and by the head."""
    low, room = float(shoulders[1]), float(body.place("head")[1] - shoulders[1])
    waist = line.narrowest(0.35 * line.length, line.length)
    slim = float(np.interp(waist, line.arcs, line.girths))
    wide = np.flatnonzero((line.arcs > waist) & (line.girths > _WIDENED * slim))
    seam = line.points[wide[0]] if len(wide) else line.points[-1]
    by_waist = low + template.neck_to_waist * (line.at(waist)[1] - low)
    height = float(np.median([by_waist, seam[1], low + template.neck_to_crown * room]))
    return np.array([shoulders[0], height, (line.at(waist)[2] + seam[2]) / 2])


def _on_trunk(
    body: Extremities, hips: NDArray[np.float64], neck: NDArray[np.float64], share: float
) -> NDArray[np.float64]:
    """A spine joint: at its share of the height, midway of the straight line and the trunk's middle."""
    straight = hips + share * (neck - hips)
    middle = trunk_middle(body, float(straight[1]))
    return np.array([straight[0], straight[1], (straight[2] + middle[2]) / 2])


def _vertex_at(body: Extremities, place: NDArray[np.float64]) -> int:
    return int(np.argmin(np.linalg.norm(body.graph.vertices - place, axis=1)))
