"""A character's skin painted by how it is bound: by bone, by part, by one bone's weights, by material."""

import colorsys
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deformation.character import Character
from deformation.shape_matching import WIDEST
from devices.frame import frozen

_COLD, _HOT = np.array([0.23, 0.30, 0.55]), np.array([0.93, 0.30, 0.16])
_GOLDEN = 0.381966
"""Share of a turn between the hues of one number and the next: neighbours never look alike."""


class SkinColours:
    """The paints of `capture.viewing.PAINTS` on one character, each worked out when it is first asked for."""

    def __init__(self, character: Character, own: ArrayLike) -> None:
        """own: (3,) or (V, 3) sRGB, what the character wears."""
        self._own, self.character = own, character
        self._made: dict[tuple[str, int], NDArray[np.float64]] = {}

    def painted(self, paint: str, bone: int = 0) -> ArrayLike:
        """(V, 3) sRGB under a paint, or what the character wears; bone: joint whose weights are shown, any number."""
        if paint not in _PAINTERS:
            return self._own
        key = (paint, bone % len(self.character.skeleton) if paint == "weights" else 0)
        if key not in self._made:
            self._made[key] = frozen(_PAINTERS[paint](self.character, key[1]))
        return self._made[key]

    def legend(self, paint: str, bone: int = 0) -> str:
        """What the paint shows, in a few words; empty for the character's own colours."""
        words = _LEGENDS.get(paint, "")
        return words.format(joint=self.character.skeleton.names[bone % len(self.character.skeleton)])


def _by_bone(character: Character, _: int) -> NDArray[np.float64]:
    return _hues(len(character.skeleton))[character.vertex_joints[:, 0]]


def _by_part(character: Character, _: int) -> NDArray[np.float64]:
    parts = character.parts
    return _hues(len(character.skeleton))[parts.joints[parts.part_of[_nearest_particle(character)]]]


def _by_weight(character: Character, bone: int) -> NDArray[np.float64]:
    return _heat(np.where(character.vertex_joints == bone, character.vertex_weights, 0).sum(axis=1))


def _by_softness(character: Character, _: int) -> NDArray[np.float64]:
    return _heat(_on_vertices(character, character.softness))


def _by_half_width(character: Character, _: int) -> NDArray[np.float64]:
    return _heat((_on_vertices(character, character.regions.half_widths) - 1) / (WIDEST - 1))


def _on_vertices(character: Character, values: NDArray[np.floating | np.integer]) -> NDArray[np.float64]:
    corners = character.lattice.cells[character.lattice.vertex_cells]
    return np.asarray(values, np.float64)[corners] @ np.ones(8) / 8


def _nearest_particle(character: Character) -> NDArray[np.int32]:
    lattice = character.lattice
    corner = lattice.vertex_weights.argmax(axis=1)
    return lattice.cells[lattice.vertex_cells, corner]


def _heat(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V, 3) from cold to hot for shares (V,) from 0 to 1."""
    share = np.clip(share, 0, 1)[:, None]
    return (1 - share) * _COLD + share * _HOT


def _hues(count: int) -> NDArray[np.float64]:
    """(count, 3) colours that tell neighbours in a skeleton apart."""
    return np.array([colorsys.hsv_to_rgb(_GOLDEN * n % 1.0, 0.62, 0.92 - 0.22 * (n % 2)) for n in range(count)])


_PAINTERS: Mapping[str, Callable[[Character, int], NDArray[np.float64]]] = {
    "bones": _by_bone,
    "parts": _by_part,
    "weights": _by_weight,
    "softness": _by_softness,
    "regions": _by_half_width,
}
_LEGENDS: Mapping[str, str] = {
    "bones": "painted by the strongest bone",
    "parts": "painted by joint-dependent part",
    "weights": "painted by the weight of {joint}",
    "softness": "painted by softness, blue rigid, red soft",
    "regions": "painted by region half-width, blue 1, red 5",
}
