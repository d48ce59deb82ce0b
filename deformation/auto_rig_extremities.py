"""The ends of a character's limbs and what they are: feet, hands, head, tail."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from deformation.isocurves_geodesic import SurfaceGraph, mean_distance, peaks
from devices.errors import SixpointError

_LEAST_LIMB = 0.08
"""A limb's least height in the mean distance, as a share of the greatest: ears and fingers are lower than a neck."""

_FLOOR_BAND = 0.12
"""Tips so near the lowest point, as a share of the height, stand on the floor."""


@dataclass(frozen=True, eq=False)
class Extremities:
    """Limb ends of an upright character that faces +Z, its left side at +X.

    graph: its surface, turned so. turn: (3, 3) the rotation about +Y that did it: turned = vertex @ turn.T.
    tips: vertices by name; fields: (V,) metres along the surface from each tip. others: further tips, unnamed.
    """

    graph: SurfaceGraph
    turn: NDArray[np.float64]
    tips: dict[str, int]
    fields: dict[str, NDArray[np.float64]]
    others: tuple[int, ...]
    upright: bool = False

    @property
    def height(self) -> float:
        """Metres from the lowest point to the crown; to the highest point of an animal, whose head is no measure."""
        at = self.graph.vertices[:, 1]
        top = at[self.tips["head"]] if self.upright else at.max()
        return float(top - at.min())

    def place(self, name: str) -> NDArray[np.float64]:
        """(3,) metres of a tip."""
        return self.graph.vertices[self.tips[name]]


def limb_tips(graph: SurfaceGraph) -> list[int]:
    """Ends of limbs, the longest first."""
    field = mean_distance(graph)
    return [int(top) for top in peaks(graph, field, _LEAST_LIMB * float(field.max())).tops]


def standing_tips(graph: SurfaceGraph, tips: Sequence[int]) -> list[int]:
    """Those of the tips that are on the floor."""
    height = graph.vertices[:, 1] - graph.vertices[:, 1].min()
    return [tip for tip in tips if height[tip] < _FLOOR_BAND * height.max()]


def human_extremities(graph: SurfaceGraph, tips: Sequence[int]) -> Extremities:
    """Two feet, two hands and a head, told apart by who is how far from whom, which no pose changes.

    Raises SixpointError saying which of them cannot be found.
    """
    feet = standing_tips(graph, tips)[:2]
    rest = [tip for tip in tips if tip not in feet][:6]
    if len(feet) < 2 or len(rest) < 3:
        raise SixpointError(
            f"no person: found {len(feet)} ends of limbs on the floor and {len(rest)} above it where two feet, two "
            "hands and a head are needed; limbs must stand clear of the body"
        )
    far = {tip: graph.distances(tip) for tip in (*feet, *rest)}

    def unlikeness(head: int, hands: tuple[int, int]) -> float:
        a, b = hands
        to_feet = [far[hand][feet[0]] + far[hand][feet[1]] for hand in hands]
        short = max(0.0, far[feet[0]][feet[1]] - far[a][b] * 1.8)
        return abs(far[head][a] - far[head][b]) + abs(to_feet[0] - to_feet[1]) / 2 + short

    choices = [(h, pair) for h in rest for pair in combinations([t for t in rest if t != h], 2)]
    rank = {tip: number for number, tip in enumerate(rest)}
    # Fingers and ears come in like pairs too: among equals the more prominent tips win.
    scale = float(np.ptp(graph.vertices[:, 1]))
    head, hands = min(choices, key=lambda c: unlikeness(*c) / scale + 0.06 * sum(rank[t] for t in (c[0], *c[1])))
    return _sided(graph, head, hands, (feet[0], feet[1]), far, [t for t in rest if t != head and t not in hands])


def _sided(
    graph: SurfaceGraph,
    head: int,
    hands: Sequence[int],
    feet: Sequence[int],
    far: dict[int, NDArray[np.float64]],
    others: list[int],
) -> Extremities:
    """Left and right from where the toes point."""
    at = graph.vertices
    near = 0.25 * float(np.ptp(at[:, 1]))
    ends = [at[far[tip] < near].mean(axis=0) for tip in hands]
    across = (ends[0] - ends[1]) * [1, 0, 1]
    across /= max(float(np.linalg.norm(across)), 1e-12)
    forward = np.cross(across, [0, 1, 0])
    if sum(_toe_direction(graph, far[foot], foot) @ forward for foot in feet) < 0:
        across, forward, hands = -across, -forward, hands[::-1]
    if (at[feet[0]] - at[feet[1]]) @ across < 0:
        feet = feet[::-1]
    turn = np.stack([across, [0.0, 1.0, 0.0], forward])
    tips = {"head": head, "left_hand": hands[0], "right_hand": hands[1], "left_foot": feet[0], "right_foot": feet[1]}
    turned = replace(graph, vertices=at @ turn.T)
    return Extremities(turned, turn, tips, {name: far[tip] for name, tip in tips.items()}, tuple(others), True)


def _toe_direction(graph: SurfaceGraph, field: NDArray[np.float64], tip: int) -> NDArray[np.float64]:
    """(3,) level, from the shank to the tip of the foot."""
    height = np.ptp(graph.vertices[:, 1])
    shank = (field > 0.2 * height) & (field < 0.3 * height)
    return (graph.vertices[tip] - graph.vertices[shank].mean(axis=0)) * [1, 0, 1]
