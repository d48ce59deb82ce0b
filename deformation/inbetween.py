"""Shapes between example poses of one mesh, by time (paper figs. 5 and 6)."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deformation.beam import BeamSettings, BeamSkin
from deformation.inbetween_skin import WholeSkin, whole_skin
from deformation.inbetween_target import turning_way
from deformation.mesh import Mesh
from devices.errors import SettingError
from devices.progress import Progress, no_progress

_STEPS_A_FRAME = 4


def inbetween(
    mesh: Mesh,
    poses: Sequence[NDArray[np.float64]],
    frames: int,
    duration_s: float = 0.5,
    settings: BeamSettings | None = None,
    progress: Progress = no_progress,
) -> Iterator[NDArray[np.float64]]:
    """Vertices (V, 3) metres: the first pose, `frames` between each pose and the next, and every pose itself, exactly.

    mesh: whose faces all poses share; triangles among them that pair are taken as quads. poses: two or more (V, 3)
    metres. duration_s: seconds from one to the next. Limbs turn on their way, as `turning_way` has it.
    Raises SettingError for fewer poses, other vertex counts, no frames, or no duration.
    """
    if len(poses) < 2 or any(pose.shape != mesh.vertices.shape for pose in poses):
        raise SettingError(
            f"poses of {', '.join(str(len(pose)) for pose in poses)} vertices: use two or more of the same mesh"
        )
    if frames < 1:
        raise SettingError(f"{frames} frames between the poses: use 1 or more")
    skin = whole_skin(mesh)
    total = (len(poses) - 1) * (frames + 1)
    yield np.array(poses[0])
    for stretch, (start, end) in enumerate(pairwise(poses)):
        shapes = _stretch(skin, mesh.with_vertices(start), end, frames, duration_s, settings)
        for number, shape in enumerate(shapes, start=1):
            progress(stretch * (frames + 1) + number, total)
            yield shape


def _stretch(
    skin: WholeSkin,
    start: Mesh,
    end: NDArray[np.float64],
    frames: int,
    duration_s: float,
    settings: BeamSettings | None,
) -> Iterator[NDArray[np.float64]]:
    """The shapes after `start`, up to `end` and with it.

    What lag is left at the end is taken out in proportion to the way gone: the force that brings the skin home.
    """
    steps = (frames + 1) * _STEPS_A_FRAME
    dt = duration_s / steps
    beams, way = BeamSkin(skin.curves, start.vertices, dt, settings), turning_way(start, end)
    last, moved, kept = np.zeros_like(end), np.empty_like(end), []
    for step in range(1, steps + 1):
        target = way(ease(step / steps)) - start.vertices
        beams.step(target, (target - last) / dt, moved)
        last = target
        if step % _STEPS_A_FRAME == 0:
            kept.append(target + skin.spread(beams.lag()))
    left = kept[-1] - (end - start.vertices)
    for number, displacement in enumerate(kept[:-1], start=1):
        yield start.vertices + displacement - ease(number / (frames + 1)) * left
    yield np.array(end)


def ease(share: float) -> float:
    """The quintic from 0 to 1 that starts and ends at rest, without a jump in acceleration."""
    return share * share * share * (10 + share * (6 * share - 15))
