"""Pictures on disk and pictures side by side."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from replay_logs.atomic_file import written_beside


def save_png(image: NDArray[np.uint8], path: str | Path, colours: int | None = None) -> None:
    """Writes (H, W, 3) sRGB bytes as PNG, beside and renamed into place. Raises OSError.

    colours: at most so many (2 to 256), for a smaller file; all of them where None.
    """
    from PIL import Image

    picture = Image.fromarray(image)
    if colours is not None:
        picture = picture.quantize(colours, dither=Image.Dither.NONE)
    with written_beside(Path(path)) as part:
        picture.save(part, format="PNG", compress_level=6 if colours is None else 9)


def contact_sheet(images: Sequence[NDArray[np.uint8]], columns: int = 4, gap: int = 6) -> NDArray[np.uint8]:
    """Pictures of one size (H, W, 3) in rows of `columns`, on white, `gap` pixels apart."""
    height, width = images[0].shape[:2]
    columns = min(columns, len(images))
    rows = -(-len(images) // columns)
    sheet = np.full((rows * (height + gap) - gap, columns * (width + gap) - gap, 3), 255, np.uint8)
    for index, image in enumerate(images):
        top, left = index // columns * (height + gap), index % columns * (width + gap)
        sheet[top : top + height, left : left + width] = image
    return sheet
