"""Our own headless renderer: `render(scene)` gives the pixels, `save_png` and `contact_sheet` keep them."""

from capture.raster.images import contact_sheet, save_png
from capture.raster.lettering import PlacedCard, placed_cards
from capture.raster.picture import lit_colours, render

__all__ = ["PlacedCard", "contact_sheet", "lit_colours", "placed_cards", "render", "save_png"]
