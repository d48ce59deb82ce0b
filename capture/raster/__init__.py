"""Our own headless renderer: `render(scene)` gives the pixels, `save_png` and `contact_sheet` keep them."""

from capture.raster.images import contact_sheet, save_png
from capture.raster.picture import render

__all__ = ["contact_sheet", "render", "save_png"]
