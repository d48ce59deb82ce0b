"""Makes the README's film anew from the shipped take: `python docs/pictures/make_demo_gif.py`."""

from pathlib import Path

import numpy as np

from capture.characters import cast
from capture.demo_take import TAKE
from capture.playing import PerformanceSource
from capture.raster import render
from capture.scenario import played, said
from capture.video import write_video
from capture.viewing import Layers

FPS = 10
SIZE = (384, 288)
SHOWN_S = ((1.0, 3.2), (5.6, 8.0), (10.2, 12.0), (15.7, 17.6), (19.0, 22.2), (25.2, 28.2))
"""Stretches of the take, from and to."""


def main() -> None:
    """Writes `demo.gif` beside this file."""
    shown = played(TAKE, said(TAKE))
    skeleton = shown.performance.motion.skeleton
    source = PerformanceSource(shown.performance, cast("mannequin", skeleton, "high", shown.reference))
    moments = np.concatenate([np.arange(begin, end, 1 / FPS) for begin, end in SHOWN_S])
    images = [render(source.scene(moment, Layers(statistics=False)), *SIZE) for moment in moments]
    write_video(images, Path(__file__).with_name("demo.gif"), FPS)


if __name__ == "__main__":
    main()
