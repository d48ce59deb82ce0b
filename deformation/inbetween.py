"""Shapes between example poses of one mesh, by time (paper figs. 5 and 6)."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deformation.beam import BeamSettings, BeamSkin
from deformation.curve_skeleton import tube_rings
from deformation.inbetween_target import turning_way
from deformation.isocurves import IsoCurves, iso_curves, tubes
from deformation.isocurves_pairing import paired_quads
from deformation.mesh import Mesh
from devices.errors import SettingError
from devices.progress import Progress, no_progress

_STEPS_A_FRAME = 4

_ROUND = 1.2
"""Tubes of rings less round than that run along a limb, not around it: an ellipse of 4 to 1 has 1.2."""

_FADING = 4
"""Rings over which the lag fades out towards a tube's end."""


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
    curves, shown = skin_curves(mesh)
    total = (len(poses) - 1) * (frames + 1)
    yield np.array(poses[0])
    for stretch, (start, end) in enumerate(pairwise(poses)):
        shapes = _stretch(curves, shown, mesh.with_vertices(start), end, frames, duration_s, settings)
        for number, shape in enumerate(shapes, start=1):
            progress(stretch * (frames + 1) + number, total)
            yield shape


def skin_curves(mesh: Mesh) -> tuple[IsoCurves, NDArray[np.float64]]:
    """The curves to bend, and (V,) how much of its lag each vertex shows, 0 to 1.

    These are the rings of tubes, fading out over the last few towards a tube's end; every curve where there are none.
    A curve that runs on from an arm over the trunk into a leg bends with the skeleton, not as skin does; it is known by
    the shorter rings that cross it. Triangles that pair are taken as quads.
    """
    quads = mesh if len(mesh.quads) else paired_quads(mesh)[0]
    curves = iso_curves(quads)
    chains = tubes(quads, curves)
    shown = np.zeros(len(mesh.vertices))
    shortest = np.full(len(mesh.vertices), np.inf)
    girths = tube_rings(mesh.vertices, curves, chains).girths
    for ring, girth in zip(chains.curves, girths, strict=True):
        members = curves.curve(int(ring))
        shortest[members] = np.minimum(shortest[members], girth)
    rings = []
    for number in range(len(chains)):
        tube, girth = chains.tube(number), girths[chains.starts[number] : chains.starts[number + 1]]
        own = [curves.curve(int(ring)) for ring in tube]
        crossed = [shortest[ring] < size for ring, size in zip(own, girth, strict=True)]
        round_enough = np.median([_spread(mesh.vertices[ring]) for ring in own]) < _ROUND
        if round_enough and np.concatenate(crossed).mean() < 0.5:
            from_end = 1 + np.minimum(np.arange(len(tube)), np.arange(len(tube))[::-1])
            for ring, share in zip(own, np.minimum(from_end / _FADING, 1.0), strict=True):
                shown[ring] = share
            rings.append(tube)
    if not rings:
        return curves, np.ones(len(mesh.vertices))
    return curves.only(np.concatenate(rings)), shown


def _spread(ring: NDArray[np.float64]) -> float:
    """How far a ring (n, 3) is from round: the difference of its farthest and nearest point over their mean distance.

    The paper's measure of which direction runs around a limb (its fig. 2).
    """
    away = np.linalg.norm(ring - ring.mean(axis=0), axis=1)
    return float(np.ptp(away) / max(float(away.mean()), 1e-12))


def _stretch(
    curves: IsoCurves,
    shown: NDArray[np.float64],
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
    skin, way = BeamSkin(curves, start.vertices, dt, settings), turning_way(start, end)
    last, moved, kept = np.zeros_like(end), np.empty_like(end), []
    for step in range(1, steps + 1):
        target = way(ease(step / steps)) - start.vertices
        skin.step(target, (target - last) / dt, moved)
        last = target
        if step % _STEPS_A_FRAME == 0:
            kept.append(target + shown[:, None] * (moved - target))
    left = kept[-1] - (end - start.vertices)
    for number, displacement in enumerate(kept[:-1], start=1):
        yield start.vertices + displacement - ease(number / (frames + 1)) * left
    yield np.array(end)


def ease(share: float) -> float:
    """The quintic from 0 to 1 that starts and ends at rest, without a jump in acceleration."""
    return share * share * share * (10 + share * (6 * share - 15))
