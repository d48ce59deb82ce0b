"""Draws the deformation paper's figures 5, 7 and 8 anew: `python -m tests.benchmarks.figures_deform docs/pictures`."""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.raster import contact_sheet, render, save_png
from capture.scene import CLAY, LATTICE, Camera, Floor, Lines, Scene, Surface
from capture.skin_colours import SkinColours
from capture.volume_report import HARD_POSES, Turns, posed
from deformation.character import Character, LatticeSettings, make_character
from deformation.deformer import Deformer, DeformSettings
from deformation.mannequin import mannequin
from deformation.skinning import joint_motion, linear_blend
from deformation.surface import interpolate_reference, normals_reference
from reconstruction.standard_body import standard_skeleton

_SIZE = (420, 520)
_CELL_EDGES = np.array([(a, b) for a in range(8) for b in range(8) if a < b and (a ^ b) in (1, 2, 4)])

STEP: Turns = {
    "left_upper_leg": (-100, 0, 5),
    "left_lower_leg": (95, 0, 0),
    "right_lower_leg": (30, 0, 0),
    "left_lower_arm": (0, -100, 0),
    "right_lower_arm": (0, 100, 0),
    "left_upper_arm": (0, 0, -50),
    "right_upper_arm": (0, 0, 40),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    skeleton = standard_skeleton()
    mesh, bind = mannequin(skeleton, "high")
    coarse, fine = (
        make_character(mesh, skeleton, bind, settings=LatticeSettings(particles=count)) for count in (1072, 3058)
    )
    save_png(contact_sheet([*resolution(coarse), *resolution(fine)], 4), folder / "deformation_resolution.png", 256)
    save_png(contact_sheet(volume_kept(fine), 4), folder / "deformation_volume.png", 256)
    save_png(contact_sheet(paints(fine), 4), folder / "deformation_parts.png", 256)


def resolution(character: Character) -> list[NDArray[np.uint8]]:
    """Figure 7: a bent body and its lattice."""
    particles = Deformer(character, DeformSettings(secondary=None)).skin(posed(character.skeleton, STEP))
    return [picture(character, particles, 0.7), picture(character, particles, 0.7, lattice=True)]


def volume_kept(character: Character) -> list[NDArray[np.uint8]]:
    """Figure 8: plain linear blending in the first row, all of ours in the second."""
    deformer = Deformer(character, DeformSettings(secondary=None))
    forearm = character.skeleton.humanoid["left_lower_arm"]
    rows: tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]] = ([], [])
    for name, yaw, close in (
        ("deep squat", 0.9, -1),
        ("hip 90", 1.2, -1),
        ("elbows 90", 0.5, -1),
        ("forearm twist 150", 0.2, forearm),
    ):
        joints = posed(character.skeleton, HARD_POSES[name])
        motion = joint_motion(joints, character.bind_inverse)
        linear = linear_blend(motion, character.binding, character.lattice.particles)
        around = joints[close, :3, 3] + [[-0.05, -0.2, -0.2], [0.45, 0.2, 0.2]] if close >= 0 else None
        rows[0].append(picture(character, linear, yaw, around=around))
        rows[1].append(picture(character, deformer.skin(joints), yaw, around=around))
    return rows[0] + rows[1]


def paints(character: Character) -> list[NDArray[np.uint8]]:
    """Figure 5: bone-dependent and joint-dependent parts; then the weights of one bone, and how soft the flesh is."""
    colours = SkinColours(character, CLAY)
    thigh = character.skeleton.humanoid["left_upper_leg"]
    shown = [("bones", 0), ("parts", 0), ("weights", thigh), ("softness", 0)]
    return [
        picture(character, character.lattice.particles, 0.35, colours=colours.painted(paint, bone))
        for paint, bone in shown
    ]


def picture(
    character: Character,
    particles: NDArray[np.float64],
    yaw: float,
    lattice: bool = False,
    around: NDArray[np.float64] | None = None,
    colours: ArrayLike = CLAY,
) -> NDArray[np.uint8]:
    """One body (H, W, 3), seen from `yaw` radians; `around`: (2, 3) metres, corners of what is to fill the picture."""
    vertices = interpolate_reference(character.lattice, particles)
    normals = normals_reference(character.mesh, vertices)
    edges = np.unique(np.sort(character.lattice.cells[:, _CELL_EDGES].reshape(-1, 2), axis=1), axis=0)
    lines = (Lines(particles.copy(), edges, LATTICE, width=1.0, opacity=0.8),) if lattice else ()
    camera = Camera(yaw=yaw).framed(vertices if around is None else around, _SIZE[0] / _SIZE[1])
    surface = Surface(vertices, character.mesh.triangulated, normals, colours)
    return render(Scene((surface,), lines, camera=camera, floor=Floor(float(vertices[:, 1].min()))), *_SIZE)


if __name__ == "__main__":
    main()
