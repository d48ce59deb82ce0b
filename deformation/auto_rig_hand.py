"""The joints of a hand's fingers: of a body's hands, where its surface shows fingers, and of a hand alone (fig. 4g).

Fingers are peaks of the distance from the wrist along the surface, each up to the web where it parts from the next. The
thumb is the one that parts nearest to the wrist. Joints lie at a finger's bends of 20 degrees or more, else at its
phalanges' shares; the knuckles lie under the webs.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components, dijkstra

from deformation.curve_skeleton import MINIMAL_BEND, CentreLine, downsampled, turn_between
from deformation.isocurves_geodesic import SurfaceGraph, level_rings, peaks
from deformation.rig_templates import FINGER_NAMES, HAND, HandTemplate
from devices.errors import SixpointError

Joints = dict[str, NDArray[np.float64]]
LineOf = Callable[[str, int, NDArray[np.float64], float, float | None], CentreLine]
"""A limb's centre line by its name, tip, field (V,) metres from the tip, reach and step in metres."""

_LEAST_FINGER = 0.06
"""A finger's least height over its web, as a share of the way from the wrist to the farthest tip."""

_FEWEST = 3
"""With fewer fingers it is a mitten."""

_FAR = 1e3
"""Metres: farther than anything, for vertices that are not of the hand."""

_CUT = 0.1
"""The ring that parts a hand from its arm is so wide, as a share of the hand."""

_AT_WRIST = 0.4
"""And no farther from the wrist's joint than that."""

_CLOSE = 0.6
"""Roots of neighbouring fingers are nearer to each other than that share of a finger's length."""

_BEND_NEAR = 0.3
"""A bend is a phalanx's joint if it lies so near to its place, as a share of that phalanx."""


@dataclass(frozen=True, eq=False)
class Finger:
    """A finger before it has a name. tip: vertex; web: metres from the wrist to where it parts from the next.

    line: its middle, from the tip to the web.
    """

    tip: int
    web: float
    line: CentreLine


def finger_joints(
    graph: SurfaceGraph,
    wrist: NDArray[np.float64],
    field: NDArray[np.float64],
    side: str,
    line_of: LineOf,
    template: HandTemplate = HAND,
) -> Joints:
    """Finger joints' places (3,) metres by name, those of `rig_templates.finger_tree(side)`; none for a mitten.

    wrist: (3,) metres, the joint; field: (V,) metres along the surface from the wrist, negative outside of the hand.
    """
    fingers = _fingers(graph, field, side, line_of)
    if len(fingers) < _FEWEST:
        return {}
    joints: Joints = {}
    size = max(float(np.linalg.norm(finger.line.points[0] - wrist)) for finger in fingers)
    for name, finger in zip(FINGER_NAMES, _in_order(fingers), strict=False):
        place = _thumb if name == "thumb" else _long_finger
        joints |= {f"{side}_{name}_{part}": p for part, p in place(finger.line, wrist, size, template).items()}
    return joints


def hand_field(graph: SurfaceGraph, tip_field: NDArray[np.float64], wrist: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V,) metres along the surface from a body's wrist (3,) on, -1 for what is not of that hand.

    tip_field: (V,) metres from the hand's tip. Its level around the wrist parts the hand from the arm; a thumb may be
    as far from the tip.
    """
    away = np.linalg.norm(graph.vertices - wrist, axis=1)
    reach = float(tip_field[np.argmin(away)])
    around = (np.abs(tip_field / reach - 1 + _CUT / 2) < _CUT / 2) & (away < _AT_WRIST * reach)
    rest = np.flatnonzero(~around)
    _, piece = connected_components(graph.ways[rest][:, rest], directed=False)
    hand = rest[piece == piece[np.argmin(tip_field[rest])]]
    if tip_field[hand].max() > 2 * reach:
        hand = np.flatnonzero(tip_field <= reach)
    own = np.union1d(hand, np.flatnonzero(around))
    field = np.full(len(tip_field), -1.0)
    start = np.flatnonzero(around[own])
    found = dijkstra(graph.ways[own][:, own], directed=False, indices=start, min_only=True)
    field[own] = np.where(np.isfinite(found), found, -1.0)
    return field


def alone_hand(graph: SurfaceGraph, tips: list[int], rim: NDArray[np.int64], line_of: LineOf) -> tuple[str, Joints]:
    """Which side a hand without a body is of, and the places (3,) metres of all its joints by name.

    rim: the vertices of its open end, if it has one. Raises SixpointError where fewer than three fingers are found.
    """
    field = graph.distances([int(v) for v in rim]) if len(rim) else graph.distances(_stump(graph, tips))
    rings = level_rings(graph, field, np.linspace(0.02, 0.4, 32) * float(field.max()))
    if not len(rings.levels):
        raise SixpointError("no hand: its surface has no rings around a wrist")
    narrow = int(np.argmin(rings.girths))
    wrist = rings.centres[narrow]
    joints = finger_joints(graph, wrist, field - rings.levels[narrow], "left", line_of)
    if "left_index_proximal" not in joints:
        raise SixpointError("no hand: fewer than three fingers stand clear of each other")
    side = _side(wrist, joints)
    named = {name.replace("left", side, 1): place for name, place in joints.items()}
    return side, {f"{side}_hand": wrist} | named


def looks_like_a_hand(side: str, joints: Joints) -> bool:
    """Whether it has a thumb and four fingers that point one way from roots close together, as no body's limbs do."""
    wrist = joints[f"{side}_hand"]
    roots = [joints.get(f"{side}_{finger}_proximal") for finger in FINGER_NAMES[1:]]
    if any(root is None for root in roots):
        return False
    bases = np.array(roots)
    fingers = np.array([joints[f"{side}_{finger}_distal_end"] for finger in FINGER_NAMES[1:]]) - bases
    lengths = np.linalg.norm(fingers, axis=1)
    way = bases.mean(axis=0) - wrist
    apart = np.linalg.norm(np.diff(bases, axis=0), axis=1)
    return bool((fingers @ way > 0).all() and apart.max() < _CLOSE * np.median(lengths))


def _stump(graph: SurfaceGraph, tips: list[int]) -> int:
    """The end with the widest ring near it: no finger is as thick as a wrist."""
    size = float(max(graph.distances(tips[0])))

    def girth(tip: int) -> float:
        rings = level_rings(graph, graph.distances(tip), np.linspace(0.05, 0.2, 7) * size)
        return float(np.median(rings.girths))

    return max(tips, key=girth)


def _side(wrist: NDArray[np.float64], joints: Joints) -> str:
    """Left or right: fingers, thumb included, bend towards the palm."""
    proximal = {name: joints[f"left_{name}_proximal"] for name in FINGER_NAMES if f"left_{name}_proximal" in joints}
    last = [name for name in FINGER_NAMES if name in proximal][-1]
    across = proximal[last] - proximal["index"]
    along = (proximal[last] + proximal["index"]) / 2 - wrist
    back = np.cross(across, along)
    ends = [joints[f"left_{name}_distal_end"] - proximal[name] for name in proximal if name != "thumb"]
    palmward = sum(float(end @ back) for end in ends)
    if "thumb" in proximal:
        palmward += 2 * float((joints["left_thumb_distal_end"] - wrist) @ back)
    return "left" if palmward > 0 else "right"


def _fingers(graph: SurfaceGraph, field: NDArray[np.float64], side: str, line_of: LineOf) -> list[Finger]:
    """Up to five, the most prominent first."""
    own = np.flatnonzero(field >= 0)
    found = peaks(graph, np.maximum(field, 0.0), _LEAST_FINGER * float(field.max()))
    tops = [k for k in range(len(found.tops)) if field[found.tops[k]] > 0][:5]
    saddles = [int(found.saddles[k]) for k in tops if found.saddles[k] >= 0]
    fingers = []
    for number, k in enumerate(tops):
        tip = int(found.tops[k])
        web = float(field[found.saddles[k]] if found.saddles[k] >= 0 else field[saddles].max(initial=0.0))
        away = np.full(len(field), _FAR)
        away[own] = np.minimum(dijkstra(graph.ways[own][:, own], directed=False, indices=_place(own, tip)), _FAR)
        between = [found.saddles[k]] if found.saddles[k] >= 0 else saddles
        reach = float(min((away[saddle] for saddle in between), default=field[tip]))
        line = line_of(f"{side}_finger_{number}", tip, away, reach, reach / 16)
        outer = line.girths[(line.arcs > 0) & (line.arcs < line.length / 2)]
        if len(outer) > 1 and line.length > float(np.median(outer)) / np.pi:
            fingers.append(Finger(tip, web, line))
    return fingers


def _place(own: NDArray[np.int64], vertex: int) -> int:
    return int(np.searchsorted(own, vertex))


def _in_order(fingers: list[Finger]) -> list[Finger]:
    """The thumb, which parts nearest to the wrist, then from index to little finger."""
    thumb = min(fingers, key=lambda finger: finger.web)
    others = [finger for finger in fingers if finger is not thumb]
    bases = np.array([finger.line.points[-1] for finger in others])
    across = np.linalg.svd(bases - bases.mean(axis=0))[2][0] if len(bases) > 1 else np.ones(3)
    if (thumb.line.points[-1] - bases.mean(axis=0)) @ across > 0:
        across = -across
    return [thumb, *(others[k] for k in np.argsort(bases @ across))]


def _long_finger(line: CentreLine, wrist: NDArray[np.float64], size: float, template: HandTemplate) -> Joints:
    """Knuckle under the web, two joints on the way to the tip."""
    proximal, middle, distal = template.phalanges
    shown = distal + middle + (1 - template.under_web) * proximal
    unit = line.length / shown
    outer = _bent_near(line, distal * unit, distal * unit)
    inner = _bent_near(line, (distal + middle) * unit, middle * unit)
    under = template.under_web * proximal * unit
    knuckle = line.points[-1] + under * _towards(line, wrist)
    return {"proximal": knuckle, "intermediate": inner, "distal": outer, "distal_end": line.points[0]}


def _thumb(line: CentreLine, wrist: NDArray[np.float64], size: float, template: HandTemplate) -> Joints:
    """The last joint on the thumb, the one under its web, and its saddle joint near the wrist."""
    metacarpal, proximal, distal = template.thumb
    unit = line.length / (distal + (1 - template.under_web) * proximal)
    outer = _bent_near(line, distal * unit, distal * unit)
    knuckle = line.points[-1] + template.under_web * proximal * unit * _towards(line, wrist)
    to_wrist = wrist - knuckle
    share = min(metacarpal * size / max(float(np.linalg.norm(to_wrist)), 1e-9), _THUMB_ROOT)
    return {
        "metacarpal": knuckle + share * to_wrist,
        "proximal": knuckle,
        "distal": outer,
        "distal_end": line.points[0],
    }


_THUMB_ROOT = 0.8
"""The thumb's saddle joint lies no farther than that share of the way from its knuckle to the wrist."""


def _towards(line: CentreLine, wrist: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) unit: on from the finger's root, midway of its own direction and that to the wrist."""
    _, tipwards = line.axis(0.55 * line.length, line.length)
    to_wrist = wrist - line.points[-1]
    way = to_wrist / max(float(np.linalg.norm(to_wrist)), 1e-9) - tipwards
    return way / max(float(np.linalg.norm(way)), 1e-9)


def _bent_near(line: CentreLine, arc: float, phalanx: float) -> NDArray[np.float64]:
    """(3,) the bend near an arc length, or the point there where the finger is straight."""
    corners = downsampled(line)
    near = [
        float(line.arcs[b])
        for a, b, c in zip(corners, corners[1:], corners[2:], strict=False)
        if turn_between(line.points[b] - line.points[a], line.points[c] - line.points[b]) >= MINIMAL_BEND
    ]
    near = [bend for bend in near if abs(bend - arc) < _BEND_NEAR * phalanx]
    return line.at(min(near, key=lambda bend: abs(bend - arc), default=arc))
