"""The centre line of a limb: from the tubes around it where the mesh has some, from geodesic slices elsewhere."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deformation.curve_skeleton import CentreLine, TubeRings, centre_line, tube_rings
from deformation.isocurves import IsoCurves, Tubes
from deformation.isocurves_geodesic import Rings, SurfaceGraph, level_rings
from devices.frame import frozen

_STEP = 0.01
"""Metres between slices as a share of the mesh's height."""

_LEAST_GIRTH, _MOST_GIRTH = 0.8, 1.5
"""A tube's ring is around the limb, no eye or nail on it and no curve along it, between those shares of the slice's."""

_MOST_LONELY = 0.5
"""Where more of a limb's slices than that have no curve near, curves and slices would alternate: then slices alone."""


@dataclass(frozen=True, eq=False)
class LimbCurves:
    """What a limb's rings are made from. tube_rings and curves are None for a mesh without tubes."""

    graph: SurfaceGraph
    curves: IsoCurves | None
    rings: TubeRings | None

    def line(
        self, tip: int, field: NDArray[np.float64], reach: float, step: float | None = None
    ) -> tuple[CentreLine, int]:
        """The centre line from a tip to `reach` metres along the surface, and how many of its rings are curves.

        field: (V,) metres from the tip. step: metres between slices; a share of the mesh's height otherwise.
        """
        step = step or _STEP * float(np.ptp(self.graph.vertices[:, 1]))
        sliced = level_rings(self.graph, field, np.arange(step, reach, step))
        rings, walked = self._with_tubes(sliced, field, reach, 2.5 * step)
        return centre_line(self.graph.vertices[tip], rings), walked

    def _with_tubes(self, sliced: Rings, field: NDArray[np.float64], reach: float, gap: float) -> tuple[Rings, int]:
        if self.curves is None or self.rings is None or not len(self.rings.curves) or not len(sliced.levels):
            return sliced, 0
        levels = _means(field[self.graph.places[self.curves.vertices]], self.curves.starts)[self.rings.curves]
        around = [np.interp(levels, sliced.levels, sliced.centres[:, i]) for i in range(3)]
        girth = np.interp(levels, sliced.levels, sliced.girths)
        away = np.linalg.norm(self.rings.centres - np.stack(around, axis=1), axis=1)
        fits = (
            (self.rings.girths > _LEAST_GIRTH * girth)
            & (self.rings.girths < _MOST_GIRTH * girth)
            & (away < girth / (2 * np.pi))
            & (levels < reach)
        )
        if not fits.any():
            return sliced, 0
        lonely = np.abs(sliced.levels[:, None] - levels[fits]).min(axis=1) > gap
        if lonely.mean() > _MOST_LONELY:
            return sliced, 0
        joined = [
            np.concatenate([own[fits], other[lonely]])
            for own, other in (
                (levels, sliced.levels),
                (self.rings.centres, sliced.centres),
                (self.rings.girths, sliced.girths),
            )
        ]
        order = np.argsort(joined[0], kind="stable")
        return Rings(*(frozen(column[order]) for column in joined)), int(fits.sum())

    def turned(self, graph: SurfaceGraph) -> "LimbCurves":
        """The same over a graph with its vertices elsewhere: rings follow by their change of place."""
        if self.curves is None or self.rings is None:
            return replace(self, graph=graph)
        turn = np.linalg.lstsq(self.graph.vertices, graph.vertices, rcond=None)[0]
        return LimbCurves(graph, self.curves, replace(self.rings, centres=frozen(self.rings.centres @ turn)))


def _means(values: NDArray[np.float64], starts: NDArray[np.int32]) -> NDArray[np.float64]:
    """(C,) means of values (N,) that lie one curve after another."""
    total = np.r_[0.0, np.cumsum(values)]
    return (total[starts[1:]] - total[starts[:-1]]) / np.diff(starts)


def limb_curves(
    graph: SurfaceGraph, vertices: NDArray[np.float64], curves: IsoCurves | None, tubes: Tubes | None
) -> LimbCurves:
    """From a mesh's graph, its vertices (V, 3) metres, and the curves and tubes found on it, if it has quads."""
    rings = tube_rings(vertices, curves, tubes) if curves is not None and tubes is not None else None
    return LimbCurves(graph, curves, rings)
