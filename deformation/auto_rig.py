"""A skeleton for a mesh that has none: curves, curve skeleton, then joints under names that all the system knows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deformation.auto_rig_extremities import Extremities, human_extremities, limb_tips, standing_tips
from deformation.auto_rig_hand import LineOf, alone_hand, finger_joints, hand_field, looks_like_a_hand
from deformation.auto_rig_human import human_joints
from deformation.auto_rig_quadruped import quadruped_extremities, quadruped_joints
from deformation.character_files import Rig
from deformation.curve_skeleton import CentreLine
from deformation.curve_skeleton_limbs import LimbCurves, limb_curves
from deformation.isocurves import IsoCurves, Tubes, iso_curves, tubes
from deformation.isocurves_geodesic import SurfaceGraph, open_rim, surface_graph
from deformation.isocurves_pairing import paired_quads
from deformation.mesh import Mesh
from deformation.rig_templates import HAND_TREES, HUMAN_TREE, QUADRUPED_TREE, finger_tree
from deformation.template_matching import matched_joints
from devices.errors import SixpointError, choice_error
from devices.frame import frozen
from reconstruction.skeleton import Skeleton

_PAIRED = 0.9
"""Below that share of paired triangles their quads are accidental, and so would be the curves along them."""

_LIMB = (0.05, 0.25)
"""Rays start so far from a limb's end along the surface, as shares of the height."""

TEMPLATES = ("auto", "human", "quadruped", "hand")
CURVES = ("edges", "rays")
MATCHINGS = ("anatomy", "midpoint", "triangle")


@dataclass(frozen=True, eq=False)
class AutoRig:
    """A found skeleton and what it was found from, all in the mesh's own place.

    rig: accepted wherever a file's rig is; weights are left to the lattice's heat.
    template: human, quadruped or hand. lines: the curve skeleton, limb by limb, tips first.
    curves, tubes: of the mesh's quads, or None for a mesh without. notes: the path taken, one line each.
    """

    rig: Rig
    template: str
    lines: dict[str, CentreLine]
    curves: IsoCurves | None
    tubes: Tubes | None
    notes: tuple[str, ...]


class RigNotFound(SixpointError):
    """A mesh gives no skeleton. tips: (N, 3) metres, the ends of limbs that were found on it, to be shown."""

    def __init__(self, message: str, tips: NDArray[np.float64]) -> None:
        super().__init__(message)
        self.tips = tips


@dataclass(frozen=True)
class RigSettings:
    """How a skeleton is looked for.

    template: one of TEMPLATES; `auto` tells by the number of feet on the floor. curves: `edges` follows the quads' own
    edges all over, `rays` goes from ring to ring by the paper's two-plane test (`isocurves_rays`). matching: `anatomy`,
    or, for people, the paper's `midpoint` (fig. 4e) or `triangle` (fig. 4h) form (`template_matching`).
    Raises SettingError for anything else.
    """

    template: str = "auto"
    curves: str = "edges"
    matching: str = "anatomy"

    def __post_init__(self) -> None:
        for name, choices in (("template", TEMPLATES), ("curves", CURVES), ("matching", MATCHINGS)):
            if getattr(self, name) not in choices:
                raise choice_error(name, getattr(self, name), choices)


def rig_mesh(mesh: Mesh, settings: RigSettings | None = None) -> AutoRig:
    """Finds the skeleton of an upright (Y up) character, whichever way it faces.

    Raises RigNotFound with the reason and what was found.
    """
    settings = settings or RigSettings()
    graph = surface_graph(mesh)
    tips = limb_tips(graph)
    curves, chains, notes = _curves(mesh, graph, tips, settings.curves)
    finding = _Finding(limb_curves(graph, mesh.vertices, curves, chains))
    try:
        template, tree, joints = _found(graph, tips, finding, settings)
    except SixpointError as error:
        raise RigNotFound(str(error), graph.vertices[tips]) from None
    notes = (*notes, *finding.notes(curves, chains))
    return AutoRig(rig_of(joints, tree), template, finding.lines, curves, chains, notes)


def rig_of(joints: dict[str, NDArray[np.float64]], tree: Sequence[tuple[str, str | None]]) -> Rig:
    """The rig of joints at places (3,) metres; those of the tree that have no place are left out, with all below."""
    present: list[str] = []
    parents: list[int] = []
    for name, parent in tree:
        if name in joints and (parent is None or parent in present):
            parents.append(-1 if parent is None else present.index(parent))
            present.append(name)
    positions = np.array([joints[name] for name in present])
    above = np.array(parents, np.int32)
    offsets = positions - np.where(above[:, None] >= 0, positions[above], 0.0)
    bind = np.tile(np.eye(4), (len(present), 1, 1))
    bind[:, :3, 3] = positions
    skeleton = Skeleton(tuple(present), frozen(above), frozen(offsets))
    return Rig(skeleton, tuple(present), frozen(bind), None)


def _curves(
    mesh: Mesh, graph: SurfaceGraph, tips: list[int], way: str
) -> tuple[IsoCurves | None, Tubes | None, tuple[str, ...]]:
    """Curves and tubes where the mesh is of quads or its triangles make some, and lines on the path taken."""
    quads, path = mesh, f"{len(mesh.quads)} quads"
    if 2 * len(mesh.quads) < len(mesh.triangles):
        quads, share = paired_quads(mesh)
        path = f"{share:.0%} of {len(mesh.triangles)} triangles paired to quads"
        if share < _PAIRED:
            return None, None, (f"only {path}: sliced along geodesic distances from the limbs' ends",)
    curves = iso_curves(quads)
    chains = tubes(quads, curves)
    if not len(chains):
        return None, None, (f"{path}, no tubes among them: sliced along geodesic distances from the limbs' ends",)
    if way == "edges":
        return curves, chains, (path,)
    by_rays, how = _by_rays(quads, graph, tips, curves, chains)
    return by_rays, tubes(quads, by_rays), (path, how)


def _by_rays(
    quads: Mesh, graph: SurfaceGraph, tips: list[int], curves: IsoCurves, chains: Tubes
) -> tuple[IsoCurves, str]:
    """The curves that the ray test finds, and a line on how many of the tubes' rings are among them."""
    from deformation.isocurves_rays import RayTest, clearest_seeds, ray_curves

    size = float(np.ptp(graph.vertices[:, 1]))
    test, groups = RayTest(quads), []
    for tip in tips:
        away = np.where(graph.places >= 0, graph.distances(tip)[graph.places], np.inf)
        groups.append(np.flatnonzero((away > _LIMB[0] * size) & (away < _LIMB[1] * size)))
    found = ray_curves(quads, clearest_seeds(test, groups), test)
    rings = {frozenset(curves.curve(int(number)).tolist()) for number in chains.curves}
    same = sum(frozenset(found.curve(int(number)).tolist()) in rings for number in np.flatnonzero(found.closed))
    return found, f"rays find {found.closed.sum()} closed curves, {same} of the {len(rings)} rings that edges make"


def with_joints(found: AutoRig, moved: dict[str, NDArray[np.float64]], notes: tuple[str, ...] | None = None) -> AutoRig:
    """The rig with some joints elsewhere: places (3,) metres by name, else SettingError is raised.

    notes: lines on why; otherwise that they were moved by hand.
    """
    skeleton = found.rig.skeleton
    for name in moved:
        if name not in skeleton.names:
            raise choice_error("joint", name, skeleton.names)
    places = dict(zip(skeleton.names, found.rig.bind[:, :3, 3], strict=True)) | moved
    parents = [None if p < 0 else skeleton.names[p] for p in skeleton.parents]
    tree = tuple(zip(skeleton.names, parents, strict=True))
    if notes is None:
        notes = (f"moved by hand: {', '.join(moved)}",) if moved else ()
    return replace(found, rig=rig_of(places, tree), notes=(*found.notes, *notes))


class _Finding:
    """Gives limbs their centre lines and remembers them, in the mesh's own place."""

    def __init__(self, limbs: LimbCurves) -> None:
        self._limbs = limbs
        self._walked = self._sliced = 0
        self.lines: dict[str, CentreLine] = {}

    def line_of(self, body: Extremities) -> Callable[[str, float], CentreLine]:
        """The centre lines of a turned body's limbs."""
        find = self.any_line(body.graph, body.turn)
        return lambda name, reach: find(name, body.tips[name], body.fields[name], reach, None)

    def any_line(self, graph: SurfaceGraph, turn: NDArray[np.float64]) -> LineOf:
        """The centre lines over a turned graph, by tip and field."""
        limbs = self._limbs.turned(graph)

        def find(name: str, tip: int, field: NDArray[np.float64], reach: float, step: float | None) -> CentreLine:
            line, walked = limbs.line(tip, field, reach, step)
            self._walked += walked
            self._sliced += len(line.points) - 1 - walked
            self.lines[name] = _turned(line, turn)
            return line

        return find

    def notes(self, curves: IsoCurves | None, chains: Tubes | None) -> tuple[str, ...]:
        used = f"centre lines from {self._walked} iso-parametric curves and {self._sliced} geodesic slices"
        if curves is None or chains is None:
            return (used,)
        found = f"{len(curves)} iso-parametric curves, {int(curves.closed.sum())} closed, {len(chains)} tubes"
        return (found, used)


Found = tuple[str, Sequence[tuple[str, str | None]], dict[str, NDArray[np.float64]]]
"""A template's name, its tree, and joints' places (3,) metres."""


def _found(graph: SurfaceGraph, tips: list[int], finding: _Finding, settings: RigSettings) -> Found:
    template = settings.template
    if template == "hand":
        return _hand(graph, tips, finding)
    if template == "auto":
        template = "quadruped" if len(standing_tips(graph, tips)) >= 4 else "human"
    try:
        return _animal(graph, tips, finding) if template == "quadruped" else _person(graph, tips, finding, settings)
    except SixpointError:
        if settings.template != "auto":
            raise
        before = dict(finding.lines)
        hand = _hand_if_one(graph, tips, finding)
        if hand is not None:
            return hand
        finding.lines = before
        raise


def _hand_if_one(graph: SurfaceGraph, tips: list[int], finding: _Finding) -> Found | None:
    """What is neither person nor animal may be a hand."""
    try:
        found = _hand(graph, tips, finding)
    except SixpointError:
        return None
    side = found[1][0][0].removesuffix("_hand")
    return found if looks_like_a_hand(side, found[2]) else None


def _animal(graph: SurfaceGraph, tips: list[int], finding: _Finding) -> Found:
    body = quadruped_extremities(graph, tips)
    joints = quadruped_joints(body, finding.line_of(body))
    return "quadruped", QUADRUPED_TREE, {name: place @ body.turn for name, place in joints.items()}


def _person(graph: SurfaceGraph, tips: list[int], finding: _Finding, settings: RigSettings) -> Found:
    body = human_extremities(graph, tips)
    if settings.matching == "anatomy":
        joints = human_joints(body, finding.line_of(body))
    else:
        joints = matched_joints(body, finding.line_of(body), settings.matching)
    line_of, tree = finding.any_line(body.graph, body.turn), HUMAN_TREE
    for side in ("left", "right"):
        wrist = joints[f"{side}_hand"]
        field = hand_field(body.graph, body.fields[f"{side}_hand"], wrist)
        joints |= finger_joints(body.graph, wrist, field, side, line_of)
        tree += finger_tree(side)
    return "human", tree, {name: place @ body.turn for name, place in joints.items()}


def _hand(graph: SurfaceGraph, tips: list[int], finding: _Finding) -> Found:
    finding.lines.clear()
    side, joints = alone_hand(graph, tips, open_rim(graph), finding.any_line(graph, np.eye(3)))
    return "hand", HAND_TREES[side], joints


def _turned(line: CentreLine, turn: NDArray[np.float64]) -> CentreLine:
    return CentreLine(frozen(line.points @ turn), line.girths, line.arcs)
