"""What the mannequin wears: a suit with panels, bare head and hands, shoes."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from deformation.mannequin.cage import Face
from deformation.mannequin.fitting import Patchwork
from deformation.mannequin.mannequin import RESOLUTIONS, undressed
from deformation.mesh import Mesh
from devices.errors import SettingError
from devices.frame import frozen

_SKIN = (0.87, 0.72, 0.60)
_SUIT = (0.36, 0.47, 0.60)
_PANEL = (0.20, 0.26, 0.35)
_SHOE = (0.20, 0.21, 0.24)

_OF_PART = {"head": _SKIN, "hand": _SKIN, "finger": _SKIN, "foot": _SHOE, "torso": _SUIT, "arm": _SUIT, "leg": _SUIT}
_PANELS = ("arm 2", "leg 2", "torso 1")
"""Levels of blocks in the darker colour: elbows, knees, waistband."""


def mannequin_colours(mesh: Mesh) -> NDArray[np.float64]:
    """(V, 3) sRGB, 0 to 1, for a mannequin's vertices. Raises SettingError for a mesh that is no mannequin's."""
    for resolution in RESOLUTIONS:
        if len(_colours(resolution)) == len(mesh.vertices):
            return _colours(resolution)
    raise SettingError(f"a mesh of {len(mesh.vertices)} vertices is no mannequin: use one that `mannequin` made")


@lru_cache(maxsize=len(RESOLUTIONS))
def _colours(resolution: str) -> NDArray[np.float64]:
    patches: Patchwork = undressed(resolution)
    total, count = np.zeros((len(patches.vertices), 3)), np.zeros((len(patches.vertices), 1))
    for face, grid in zip(patches.faces, patches.grids, strict=True):
        total[grid] += _colour(face)
        count[grid] += 1
    return frozen(total / count)


def _colour(face: Face) -> tuple[float, float, float]:
    return _PANEL if any(name in _PANELS for name in face.divisions) else _OF_PART[face.part]
