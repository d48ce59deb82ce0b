"""One picture with everything in it, held against the one looked at and kept.

After a change that is meant to be seen: `python -m tests.capture.test_golden_picture`, and look at the new one.
"""

from pathlib import Path

import numpy as np
from PIL import Image

from capture.raster import render, save_png
from capture.scene import BONE, Camera, Lines, Scene, Spheres, Surface

GOLDEN = Path(__file__).with_name("golden_picture.png")


def ball(centre: tuple[float, float, float], radius: float, **looks) -> Surface:
    polar, turn = np.meshgrid(np.linspace(0, np.pi, 25), np.linspace(0, 2 * np.pi, 49), indexing="ij")
    normals = np.stack([np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)], -1).reshape(-1, 3)
    number = np.arange(polar.size).reshape(polar.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return Surface(np.array(centre) + radius * normals, faces, normals, **looks)


def everything() -> Scene:
    figure = (ball((0, 0.45, 0), 0.45), ball((0, 1.15, 0.05), 0.3), ball((0.03, 1.62, 0.1), 0.2))
    ghost = ball((0.9, 0.8, -0.6), 0.4, colours=(0.45, 0.62, 0.85), opacity=0.4)
    spine = np.array([[0, 0.2, 0], [0, 0.9, 0], [0.02, 1.4, 0.05], [0.03, 1.75, 0.1]])
    return Scene(
        surfaces=(*figure, ghost),
        lines=(Lines(spine, np.array([[0, 1], [1, 2], [2, 3]]), BONE, width=3.0, through=0.6),),
        spheres=(Spheres(np.array([[-0.7, 0.9, 0.3], [0.03, 1.62, 0.34]]), 0.07, (0.16, 0.70, 0.42)),),
        camera=Camera(target=(0.1, 0.85, 0.0), distance=4.6),
    )


def test_the_picture_looks_as_it_did():
    picture = render(everything(), 240, 160).astype(int)
    difference = np.abs(picture - np.asarray(Image.open(GOLDEN)).astype(int))
    # Another processor may round otherwise at an edge here and there.
    assert difference.mean() < 0.3
    assert np.percentile(difference, 99.5) <= 6


if __name__ == "__main__":
    save_png(render(everything(), 240, 160), GOLDEN)
