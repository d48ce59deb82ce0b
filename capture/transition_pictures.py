"""Pictures of transitions, pose by pose: one row for each frame at which the first clip is left.

`python -m capture.transition_pictures FOLDER` makes those of docs/transitions.md, from the motion library.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.raster import contact_sheet, render
from capture.scene import Camera, Floor, Scene, Surface
from deformation.character import Character, mannequin_character
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Pose
from reconstruction.transition import TransitionClip, joined, prepared, ready_pair, transition
from reconstruction.transition.rebasing import heading_at

CLAY_OF_CLIP, CLAY_BETWEEN = (0.78, 0.76, 0.72), (0.93, 0.62, 0.30)
"""Poses of the clips themselves, and those that the transition makes."""
SIDE_VIEW_RAD = 1.1
"""How far round from the performer's face the camera stands."""


def transition_rows(
    a: TransitionClip,
    b: TransitionClip,
    exits: Sequence[int],
    columns: int = 8,
    method: str = "natural",
    size: tuple[int, int] = (180, 240),
) -> NDArray[np.uint8]:
    """(H, W, 3) the paper's fig. 5 and 6 for two clips: from the frame left, through the transition, to past its end.

    exits: frames of `a`, one a row; size: pixels of one pose, width and height.
    """
    b = ready_pair(a, b)
    character = mannequin_character(a.skeleton, "low")
    images = []
    for at in exits:
        step = transition(a, at, b, 0, method)
        side = heading_at(a, at) + SIDE_VIEW_RAD
        motion = joined(a, at, step, b, 0)
        count = len(step.between)
        shown = np.linspace(at, at + count + 1, columns - 1).round().astype(int)
        after = min(at + count + 1 + round(0.3 * a.fps), len(motion) - 1)
        for frame in (*shown, after):
            made = at < frame <= at + count
            pose = motion.pose(int(frame))
            images.append(_picture(character, pose, a.floor_m, side, CLAY_BETWEEN if made else CLAY_OF_CLIP, size))
    return contact_sheet(images, columns)


def _picture(
    character: Character,
    pose: Pose,
    floor_m: float,
    yaw: float,
    colour: tuple[float, float, float],
    size: tuple[int, int],
) -> NDArray[np.uint8]:
    vertices = skinned(character, pose)
    x, _, z = pose.root_position
    camera = replace(Camera(), target=(float(x), floor_m + 1.0, float(z)), distance=4.7, yaw=yaw, pitch=0.12)
    surface = Surface(vertices, character.mesh.triangulated, colours=colour)
    return render(Scene(surfaces=(surface,), camera=camera, floor=Floor(floor_m)), *size)


def skinned(character: Character, pose: Pose) -> NDArray[np.float64]:
    """(V, 3) metres: the character's vertices in a pose, by linear blending."""
    moves = world_transforms(character.skeleton, pose.root_position, pose.rotations) @ character.bind_inverse
    blended = np.einsum("vk,vkab->vab", character.vertex_weights, moves[character.vertex_joints])
    return np.einsum("vab,vb->va", blended[:, :3, :3], character.mesh.vertices) + blended[:, :3, 3]


def write_pictures(folder: Path) -> None:
    """The paper's fig. 5, walk to stand, and in place of its fig. 6 a jump, left in mid-flight too, to a run."""
    from capture.raster import save_png
    from reconstruction.motion_library import generate_library

    library = {kind: motion for motion in reversed(generate_library()) for kind in [motion.name.split("_")[0]]}
    walk, idle, jump, run = (prepared(library[kind]) for kind in ("walk", "idle", "jump", "run"))
    save_png(transition_rows(walk, idle, (150, 165, 180, 195)), folder / "transition_walk_to_stand.png", 256)
    flight = int(np.argmax(jump.motion.root_positions[:, 1]))
    save_png(
        transition_rows(jump, run, (flight - 30, flight - 12, flight, flight + 20)),
        folder / "transition_jump_to_run.png",
        256,
    )


if __name__ == "__main__":
    write_pictures(Path(sys.argv[1]))
