"""Words over a picture, in the typeface that Pillow carries."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

_INK, _PALE_INK = (38, 44, 54), (70, 78, 92)
_CARD = (0.96, 0.965, 0.975)
FIGURES_TAB = 7.0
"""Where the second column of a table of figures begins, in letter heights; the others follow at a third of that."""


def letter(
    image: NDArray[np.uint8], title: str, status: tuple[str, ...], figures: tuple[str, ...] = ()
) -> NDArray[np.uint8]:
    """`image` (H, W, 3) with the title at the top left, status lines at the bottom left, a table at the top right."""
    if not (title or status or figures):
        return image
    from PIL import Image, ImageDraw

    height, width = image.shape[:2]
    size, margin = _letter_height(height), max(height // 30, 6)
    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture)
    if title:
        draw.text((margin, margin * 0.8), title, fill=_INK, font=_font(round(size * 1.25)))
    for line, text in enumerate(reversed(status)):
        top = height - margin - (line + 1) * round(size * 1.35)
        draw.text((margin, top), text, fill=_PALE_INK, font=_font(size))
    if figures:
        card = Image.fromarray(word_card(figures, height, _CARD, tab=FIGURES_TAB))
        corner = (width - margin - card.width, margin)
        behind = picture.crop((*corner, corner[0] + card.width, corner[1] + card.height))
        picture.paste(Image.blend(behind, card, 0.8), corner)
    return np.asarray(picture)


def word_card(
    lines: tuple[str, ...],
    height: int,
    background: tuple[float, float, float],
    large: bool = False,
    tab: float = 0.0,
) -> NDArray[np.uint8]:
    """A card (h, w, 3) just large enough for lines of words, in the size that `letter` has at that picture height.

    tab: where the words after a line's first tab begin, in letter heights; after each further one, a third as much on.
    """
    from PIL import Image, ImageDraw

    size = round(_letter_height(height) * (1.25 if large else 1.0))
    font, pitch = _font(size), round(size * 1.35)
    pieces = [
        (row, _column(column) * tab * size, text)
        for row, line in enumerate(lines)
        for column, text in enumerate(line.split("\t"))
    ]
    width = max(round(left + font.getlength(text)) for _, left, text in pieces) + size
    card = Image.new("RGB", (width, pitch * len(lines) + size // 2), tuple(round(255 * c) for c in background))
    draw = ImageDraw.Draw(card)
    for row, left, text in pieces:
        place = (size // 2 + left, row * pitch + size // 4)
        draw.text(place, text, fill=_INK if large else _PALE_INK, font=font)
    return np.asarray(card)


def _column(number: int) -> float:
    return 0.0 if number == 0 else 1.0 + (number - 1) / 3


def _letter_height(picture_height: int) -> int:
    return max(picture_height // 36, 10)


@cache
def _font(size: int):
    from PIL import ImageFont

    return ImageFont.load_default(size)
