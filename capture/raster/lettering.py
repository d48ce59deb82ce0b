"""Words over a picture, in the typeface that Pillow carries."""

from functools import cache

import numpy as np
from numpy.typing import NDArray


def letter(image: NDArray[np.uint8], title: str, status: tuple[str, ...]) -> NDArray[np.uint8]:
    """`image` (H, W, 3) with the title at the top left and the status lines at the bottom left."""
    if not (title or status):
        return image
    from PIL import Image, ImageDraw

    height = image.shape[0]
    size, margin = max(height // 36, 10), max(height // 30, 6)
    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture)
    if title:
        draw.text((margin, margin * 0.8), title, fill=(38, 44, 54), font=_font(round(size * 1.25)))
    for line, text in enumerate(reversed(status)):
        top = height - margin - (line + 1) * round(size * 1.35)
        draw.text((margin, top), text, fill=(70, 78, 92), font=_font(size))
    return np.asarray(picture)


def word_card(
    lines: tuple[str, ...],
    height: int,
    background: tuple[float, float, float],
    large: bool = False,
    tab: float = 0.0,
) -> NDArray[np.uint8]:
    """A card (h, w, 3) just large enough for lines of words, in the size that `letter` has at that picture height.

    tab: where the words after a tab character begin, in letter heights.
    """
    from PIL import Image, ImageDraw

    size = round(max(height // 36, 10) * (1.25 if large else 1.0))
    font, pitch = _font(size), round(size * 1.35)
    pieces = [
        (row, column * tab * size, text)
        for row, line in enumerate(lines)
        for column, text in enumerate(line.split("\t"))
    ]
    width = max(round(left + font.getlength(text)) for _, left, text in pieces) + size
    card = Image.new("RGB", (width, pitch * len(lines) + size // 2), tuple(round(255 * c) for c in background))
    draw = ImageDraw.Draw(card)
    for row, left, text in pieces:
        place = (size // 2 + left, row * pitch + size // 4)
        draw.text(place, text, fill=(38, 44, 54) if large else (70, 78, 92), font=font)
    return np.asarray(card)


@cache
def _font(size: int):
    from PIL import ImageFont

    return ImageFont.load_default(size)
