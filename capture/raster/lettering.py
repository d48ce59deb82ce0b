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


@cache
def _font(size: int):
    from PIL import ImageFont

    return ImageFont.load_default(size)
