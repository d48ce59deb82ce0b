"""Our own headless renderer: `render(scene)` gives the pixels, `save_png` and `contact_sheet` keep them."""

from capture.raster.images import contact_sheet, save_png
from capture.raster.lettering import FIGURES_TAB, word_card
from capture.raster.picture import lit_colours, render

__all__ = ["FIGURES_TAB", "contact_sheet", "lit_colours", "render", "save_png", "word_card"]
