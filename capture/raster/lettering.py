"""The words of a scene: which cards there are, and where each lies in the picture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.raster.cards import (
    Card,
    badges_card,
    banner_card,
    keys_card,
    letter_height,
    panel_card,
    table_card,
    timeline_card,
    words_card,
)
from capture.scene import Colour, Scene

_SOLID = 0.9
"""How much of a framed card is card, and not the picture behind it."""


@dataclass(frozen=True, eq=False)
class PlacedCard:
    """A card with its upper left corner, pixels from the picture's; framed cards are laid over the picture."""

    card: Card
    left: int
    top: int
    framed: bool


def placed_cards(scene: Scene, width: int, height: int, background: Colour) -> list[PlacedCard]:
    """The words of a scene for a picture of that size, what lies on top last. background: behind unframed words."""
    margin = max(height // 34, 6)
    placed: list[PlacedCard] = []

    def put(card: Card, x: float, y: float, framed: bool) -> PlacedCard:
        """x, y: 0 at the left or top margin, 1 at the right or bottom one."""
        rows, columns = card.shape[:2]
        left, top = margin + x * (width - 2 * margin - columns), margin + y * (height - 2 * margin - rows)
        placed.append(PlacedCard(card, round(max(left, 0)), round(max(top, 0)), framed))
        return placed[-1]

    def under(card: Card, above: PlacedCard | None) -> None:
        top = margin if above is None else above.top + above.card.shape[0]
        placed.append(PlacedCard(card, margin, top, False))

    title = put(words_card((scene.title,), height, background, large=True), 0, 0, False) if scene.title else None
    if scene.badges:
        under(badges_card(scene.badges, height, background), title)
    lift = 0
    if scene.timeline is not None:
        bar = timeline_card(scene.timeline, width - 2 * margin, height, background)
        lift = bar.shape[0] // 2
        placed.append(PlacedCard(bar, margin, height - margin // 2 - bar.shape[0], False))
    for card, x in _at_the_foot(scene, height, background):
        lowest = put(card, x, 1, False)
        placed[-1] = PlacedCard(card, lowest.left, lowest.top - lift, False)
    if scene.figures:
        put(table_card(scene.figures, height), 1, 0, True)
    if scene.panel is not None and scene.panel.rows:
        put(panel_card(scene.panel, height), 0, 0.45, True)
    if scene.banner is not None:
        put(banner_card(scene.banner, height), 0, 0.45, True)
    if scene.keys:
        put(keys_card(scene.keys, height), 0.5, 0.5, True)
    return placed


def _at_the_foot(scene: Scene, height: int, background: Colour) -> list[tuple[Card, float]]:
    cards = []
    if scene.status:
        cards.append((words_card(scene.status, height, background), 0.0))
    if scene.legend:
        cards.append((badges_card(scene.legend, height, background, across=True), 1.0))
    return cards


def letter(image: NDArray[np.uint8], scene: Scene, background: Colour) -> NDArray[np.uint8]:
    """`image` (H, W, 3) sRGB bytes with the scene's words on it. background: what unframed cards were made on."""
    height, width = image.shape[:2]
    cards = placed_cards(scene, width, height, background)
    if not cards:
        return image
    image = image.copy()
    plain = np.round(255 * np.array(background))
    for placed in cards:
        top, left = placed.top, placed.left
        behind = image[top : top + placed.card.shape[0], left : left + placed.card.shape[1]]
        card = placed.card[: behind.shape[0], : behind.shape[1]].astype(np.float64)
        if placed.framed:
            behind[:] = np.round(_SOLID * card + (1 - _SOLID) * behind)
        else:
            behind[:] = np.round(np.clip(behind + (card - plain), 0, 255))
    return image


__all__ = ["PlacedCard", "letter", "letter_height", "placed_cards"]
