"""The iso-parametric curves of a character's mesh, as strokes that move with its skin."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from deformation.isocurves import iso_curves
from deformation.isocurves_pairing import paired_quads
from deformation.mesh import Mesh
from devices.frame import frozen

RING: tuple[float, float, float] = (0.83, 0.29, 0.24)
"""A closed curve that is short against the body: it runs around a limb."""
ALONG: tuple[float, float, float] = (0.20, 0.33, 0.62)
_LIMB = 0.28
"""The most that a ring extends, as a share of the whole mesh."""
_LIFT_M = 0.0015
"""So far above the skin the strokes lie, or a window would draw half of them under it."""


@dataclass(frozen=True, eq=False)
class CurveStrokes:
    """Which vertices the strokes join: segments (S, 2) int32 and their colours (S, 3) sRGB."""

    segments: NDArray[np.int32]
    colours: NDArray[np.float64]

    def lifted(self, vertices: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """(V, 3) metres: the skin's vertices, a little off it."""
        return frozen(vertices + _LIFT_M * normals)


@lru_cache(maxsize=4)
def curve_strokes(mesh: Mesh) -> CurveStrokes:
    """The curves of a mesh of quads; triangles are paired to quads first."""
    mesh = mesh if len(mesh.quads) >= len(mesh.triangles) else paired_quads(mesh)[0]
    curves = iso_curves(mesh)
    segments, colours = [np.empty((0, 2), np.int32)], [np.empty((0, 3))]
    whole = np.ptp(mesh.vertices, axis=0).max()
    for number in range(len(curves)):
        own = curves.curve(number)
        pairs = np.column_stack([own, np.roll(own, -1)])[: len(own) if curves.closed[number] else -1]
        segments.append(pairs.astype(np.int32))
        around = curves.closed[number] and np.ptp(mesh.vertices[own], axis=0).max() < _LIMB * whole
        colours.append(np.broadcast_to(RING if around else ALONG, (len(pairs), 3)))
    return CurveStrokes(frozen(np.concatenate(segments)), frozen(np.concatenate(colours)))
