"""A whole motion on a character: the deformed mesh of every frame, into an archive of vertices or into pictures."""

import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.characters import Cast
from capture.raster import render
from capture.stage import Stage
from capture.viewing import Layers
from deformation.character import Character
from deformation.deformer import DeformedMesh, Deformer, DeformSettings
from devices.progress import Progress, no_progress
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Motion
from replay_logs.atomic_file import written_beside


def deformed_frames(
    character: Character, motion: Motion, settings: DeformSettings, progress: Progress = no_progress
) -> Iterator[tuple[NDArray[np.float64], DeformedMesh]]:
    """`T_world_joint` (J, 4, 4) and the mesh of each frame, which is valid until the next is asked for."""
    deformer = Deformer(character, settings)
    transforms = world_transforms(character.skeleton, motion.root_positions, motion.rotations)
    for frame, joints in enumerate(transforms, 1):
        yield joints, deformer.deform(joints, 1 / motion.fps)
        progress(frame, len(motion))


def write_vertices(
    character: Character, motion: Motion, settings: DeformSettings, path: Path, progress: Progress = no_progress
) -> None:
    """Writes an `.npz` of `vertices` (T, V, 3) float32 metres, `quads`, `triangles`, `fps` and `name`.

    Written frame by frame beside the path and renamed into place. Raises OSError.
    """
    others = {
        "quads": character.mesh.quads,
        "triangles": character.mesh.triangles,
        "fps": np.array(motion.fps),
        "name": np.array(motion.name),
    }
    with written_beside(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_STORED) as archive:
        with archive.open("vertices.npy", "w", force_zip64=True) as file:
            shape = (len(motion), *character.mesh.vertices.shape)
            np.lib.format.write_array_header_1_0(
                file,
                {"descr": "<f4", "fortran_order": False, "shape": shape},  # type: ignore[arg-type]
            )
            for _, mesh in deformed_frames(character, motion, settings, progress):
                file.write(mesh.vertices.astype("<f4").tobytes())
        for name, array in others.items():
            with archive.open(f"{name}.npy", "w") as file:
                np.lib.format.write_array(file, array, allow_pickle=False)  # type: ignore[arg-type]


def pictures(
    chosen: Cast,
    motion: Motion,
    settings: DeformSettings,
    size: tuple[int, int] = (960, 540),
    layers: Layers | None = None,
    progress: Progress = no_progress,
) -> Iterator[NDArray[np.uint8]]:
    """A picture (H, W, 3) sRGB of each frame of a motion of the character's own; size: width and height in pixels."""
    character = chosen.character
    stage, layers = Stage(character.skeleton, chosen), layers or Layers()
    for number, (joints, mesh) in enumerate(deformed_frames(character, motion, settings, progress)):
        yield render(stage.scene(number / motion.fps, None, joints, mesh, layers), *size)
