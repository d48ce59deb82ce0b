"""A quadruped's joints: four legs from where they meet the trunk, spine, neck and head along its middle, a tail."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from deformation.auto_rig_extremities import Extremities, standing_tips
from deformation.curve_skeleton import MINIMAL_BEND, CentreLine, sharpest_bend
from deformation.isocurves_geodesic import SurfaceGraph, peaks
from deformation.rig_templates import QUADRUPED, QuadrupedTemplate
from devices.errors import SixpointError

Joints = dict[str, NDArray[np.float64]]

_SWOLLEN = 1.5
"""Rings so much longer than those two thirds up a leg run over the trunk."""


def quadruped_extremities(graph: SurfaceGraph, tips: Sequence[int]) -> Extremities:
    """Four feet, the head and, where one stands clear, the tail.

    The trunk runs between the two closest-set pairs of feet that stand across it; the head is the end with the higher
    tip. Raises SixpointError saying what cannot be found.
    """
    feet = standing_tips(graph, tips)[:4]
    rest = [tip for tip in tips if tip not in feet]
    if len(feet) < 4 or not rest:
        raise SixpointError(
            f"no quadruped: found {len(feet)} ends of limbs on the floor and {len(rest)} above it where four feet and "
            "a head are needed"
        )
    far = {tip: graph.distances(tip) for tip in feet}
    first, second = _pairs(feet, far)
    head = max(rest, key=lambda tip: float(graph.vertices[tip, 1]))
    from_head = graph.distances(head)
    front, hind = sorted((first, second), key=lambda pair: float(sum(from_head[tip] for tip in pair)))
    turn = _facing(graph, front, hind)
    turned = replace(graph, vertices=graph.vertices @ turn.T)
    nose = _nose(turned, head, from_head, hind, far)
    names = {"head": nose}
    for name, pair in (("hand", front), ("foot", hind)):
        left, right = sorted(pair, key=lambda tip: -float(turned.vertices[tip, 0]))
        names |= {f"left_{name}": left, f"right_{name}": right}
    back = [t for t in rest if t != head and turned.vertices[t, 2] < turned.vertices[list(hind), 2].mean()]
    if back:
        names["tail"] = back[0]
    fields = {name: far[tip] if tip in far else graph.distances(tip) for name, tip in names.items()}
    return Extremities(turned, turn, names, fields, tuple(t for t in rest if t not in names.values()))


def quadruped_joints(
    body: Extremities, line_of: Callable[[str, float], CentreLine], template: QuadrupedTemplate = QUADRUPED
) -> Joints:
    """Joint places (3,) metres by name, those of `rig_templates.QUADRUPED_TREE` that the animal has.

    line_of: as for `auto_rig_human.human_joints`. Raises SixpointError where the legs are not parted from the trunk.
    """
    reaches = _reaches(body)
    joints: Joints = {}
    for name in ("left_hand", "right_hand", "left_foot", "right_foot"):
        joints |= _leg(body, name, reaches[name], line_of, template)
    return joints | _trunk(body, joints, reaches, line_of, template)


def _pairs(feet: Sequence[int], far: dict[int, NDArray[np.float64]]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Front and hind feet: the pairing with the shortest ways between partners."""
    choices = [((a, b), (c, d)) for a, b, c, d in permutations(feet) if a < b and c < d and a < c]
    return min(choices, key=lambda pairs: float(sum(far[a][b] for a, b in pairs)))


def _facing(graph: SurfaceGraph, front: tuple[int, int], hind: tuple[int, int]) -> NDArray[np.float64]:
    """(3, 3) the turn about +Y that brings the way from hind to front feet onto +Z."""
    forward = graph.vertices[list(front)].mean(axis=0) - graph.vertices[list(hind)].mean(axis=0)
    forward[1] = 0
    forward /= max(float(np.linalg.norm(forward)), 1e-12)
    return np.stack([np.cross([0, 1, 0], forward), [0.0, 1.0, 0.0], forward])


def _nose(
    graph: SurfaceGraph,
    head: int,
    from_head: NDArray[np.float64],
    hind: tuple[int, int],
    far: dict[int, NDArray[np.float64]],
) -> int:
    """The foremost vertex of the head: ears may be higher, the muzzle is farther ahead."""
    from_hind = np.mean([far[tip] for tip in hind], axis=0)
    near = from_head < 0.3 * from_hind[head]
    ahead = np.where(near, graph.vertices[:, 2] + 0.2 * from_hind, -np.inf)
    return int(np.argmax(ahead))


def _reaches(body: Extremities) -> dict[str, float]:
    """Metres along the surface from each foot, and the tail, to where it meets the trunk."""
    centre = body.fields["head"]
    found = peaks(body.graph, centre, 0.03 * float(centre.max()))
    saddles = {}
    for name in body.tips:
        near = np.flatnonzero(body.fields[name][found.tops] < 0.2 * body.height)
        if name != "head" and len(near) and found.saddles[near[0]] >= 0:
            saddles[name] = int(found.saddles[near[0]])
    reaches = {name: float(body.fields[name][saddle]) for name, saddle in saddles.items()}
    hind = [saddles[name] for name in ("left_foot", "right_foot") if name in saddles]
    if "tail" in body.tips and "tail" not in reaches and hind:
        # The lake that swallows all others has no saddle of its own: it ends where it took the hind legs.
        reaches["tail"] = float(body.fields["tail"][hind].min())
    legs = [reaches.get(f"{side}_{end}") for side in ("left", "right") for end in ("hand", "foot")]
    known = [reach for reach in legs if reach is not None and reach < 1.2 * body.height]
    if len(known) < 2:
        raise SixpointError("the legs are not parted from the trunk: no place is found where they meet it")
    for end in ("hand", "foot"):
        pair = [reaches.get(f"{side}_{end}", np.inf) for side in ("left", "right")]
        # Where one leg's lake swallows the other's, its own saddle lies beyond the trunk.
        shorter = min(min(pair), max(known))
        reaches |= {f"{side}_{end}": shorter for side in ("left", "right")}
    return reaches


def _leg(
    body: Extremities,
    name: str,
    reach: float,
    line_of: Callable[[str, float], CentreLine],
    template: QuadrupedTemplate,
) -> Joints:
    """Upper joint above the seam, lower ones by bends and proportions."""
    line = _clear_of_trunk(line_of(name, reach))
    side, end = name.split("_")
    part = "arm" if end == "hand" else "leg"
    shares = template.fore_leg if end == "hand" else template.hind_leg
    top = line.points[-1] * [0.85, 1, 1] + [0, template.above_seam * line.length, 0]
    whole = line.length * (1 + template.above_seam)
    ankle_arc, knee_arc = (_bend_near(line, share, whole) for share in shares)
    return {
        f"{side}_upper_{part}": top,
        f"{side}_lower_{part}": line.at(knee_arc),
        f"{side}_{end}": line.at(ankle_arc),
        f"{side}_{end}_end": body.place(name),
    }


def _clear_of_trunk(line: CentreLine) -> CentreLine:
    """The part of a leg's line before its rings swell into the trunk."""
    usual = float(np.interp(0.65 * line.length, line.arcs, line.girths))
    swollen = np.flatnonzero((line.arcs > 0.65 * line.length) & (line.girths > _SWOLLEN * usual))
    return line.between(0.0, float(line.arcs[swollen[0]])) if len(swollen) else line


def _bend_near(line: CentreLine, share: float, whole: float) -> float:
    """The arc length of a bend near a share of a leg's length, or that share where it is straight there."""
    expected = share * whole
    span = 0.17 * whole
    low, high = max(expected - span, 0.03 * whole), min(expected + span, line.length)
    arc, bend = sharpest_bend(line.between(low, high))
    return low + arc if bend >= MINIMAL_BEND else min(expected, line.length)


def _trunk(
    body: Extremities,
    legs: Joints,
    reaches: dict[str, float],
    line_of: Callable[[str, float], CentreLine],
    template: QuadrupedTemplate,
) -> Joints:
    shoulders = (legs["left_upper_arm"] + legs["right_upper_arm"]) / 2
    hips = (legs["left_upper_leg"] + legs["right_upper_leg"]) / 2
    free = np.min([body.fields[f"{s}_{e}"] for s in ("left", "right") for e in ("hand", "foot")], axis=0)
    reach = min(reaches[f"{s}_{e}"] for s in ("left", "right") for e in ("hand", "foot"))
    trunk = free > reach
    root, withers = (_trunk_middle(body, trunk, place, template.spine_height) for place in (hips, shoulders))
    joints: Joints = {"hips": root, "upper_chest": withers}
    for name, share in zip(("spine", "chest"), template.spine, strict=True):
        joints[name] = _trunk_middle(body, trunk, root + share * (withers - root), template.spine_height)
    line = line_of("head", float(body.fields["head"][_nearest(body, withers)]))
    line = line.between(0.0, line.nearest_arc(withers))
    joints["neck"] = line.at((1 - template.neck) * line.length)
    joints["head"] = line.at((1 - template.head) * line.length)
    joints["head_end"] = body.place("head")
    for side in ("left", "right"):
        joints[f"{side}_shoulder"] = (withers + legs[f"{side}_upper_arm"]) / 2
    if "tail" in body.tips and "tail" in reaches:
        tail = line_of("tail", min(reaches["tail"], float(body.fields["tail"][_nearest(body, root)]) * 0.9))
        for number, share in enumerate((1.0, 0.75, 0.5, 0.25), start=1):
            joints[f"tail_{number}"] = tail.at(share * tail.length)
        joints["tail_end"] = body.place("tail")
    return joints


def _trunk_middle(
    body: Extremities, trunk: NDArray[np.bool_], place: NDArray[np.float64], height: float
) -> NDArray[np.float64]:
    """(3,) in the slice across the trunk at a place's z: its middle, `height` of the way from belly to back."""
    at = body.graph.vertices
    thick = 0.05 * float(np.ptp(at[:, 2]))
    near = trunk & (np.abs(at[:, 2] - place[2]) < thick) & (np.abs(at[:, 0] - place[0]) < 0.3 * body.height)
    if not near.any():
        return place
    low, high = at[near, 1].min(), at[near, 1].max()
    return np.array([place[0], low + height * (high - low), place[2]])


def _nearest(body: Extremities, place: NDArray[np.float64]) -> int:
    return int(np.argmin(np.linalg.norm(body.graph.vertices - place, axis=1)))
