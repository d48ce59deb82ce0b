"""A found skeleton in its mesh, as a picture and in the window: skin, rings of tubes, centre lines, joints."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from capture.raster import contact_sheet, render
from capture.scene import CLAY, Camera, Lines, Scene, Spheres, Surface, skeleton_marks
from capture.viewing import Layers
from deformation.auto_rig import AutoRig
from deformation.inbetween_skin import round_tubes
from deformation.mesh import Mesh
from reconstruction.skeleton import Skeleton

_SHOWN_M = 1.75
"""Marks are made for a person; meshes of any size are shown so tall, or so wide."""

_RING = (0.16, 0.52, 0.66)
_MIDDLE = (0.2, 0.45, 0.9)
_TIP = (0.85, 0.22, 0.20)


@dataclass(frozen=True, eq=False)
class RigView:
    """`FrameSource` that stands still. found: the rig, or None where there is none, with the tips (N, 3) metres that
    were found instead.
    """

    mesh: Mesh
    found: AutoRig | None
    tips: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    title: str = ""

    @property
    def duration_s(self) -> float:
        """Nothing moves."""
        return 0.0

    @property
    def frame_s(self) -> float:
        """Seconds of one step."""
        return 1 / 60

    def scene(self, time_s: float, layers: Layers) -> Scene:
        """The mesh with what is found in it; `layers` of skin, skeleton and curves count."""
        scale = _SHOWN_M / float(np.ptp(self.mesh.vertices, axis=0).max())
        surfaces, lines, balls = [], [], []
        if layers.skin:
            opacity = 0.55 if layers.skeleton or layers.curves else 1.0
            surfaces.append(Surface(self.mesh.vertices * scale, self.mesh.triangulated, None, CLAY, opacity))
        if len(self.tips):
            balls.append(Spheres(self.tips * scale, 0.03, _TIP, through=0.8))
        if self.found is not None and layers.curves:
            lines += curve_lines(self.mesh, self.found, scale)
        if self.found is not None and layers.skeleton:
            skeleton, places = self.found.rig.skeleton, self.found.rig.bind[:, :3, 3] * scale
            bones, joints = skeleton_marks(skeleton, places)
            lines.append(bones)
            balls.append(replace(joints, radii=_radii(skeleton, places)))
        words = self.found.notes if self.found is not None and layers.statistics else ()
        scene = Scene(tuple(surfaces), tuple(lines), tuple(balls), Camera(yaw=0.35), title=self.title, status=words)
        return scene.framed(1.0)


def rig_picture(view: RigView, yaws: Sequence[float] = (0.35, 1.45), size: int = 640) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB: from before and from its left."""
    layers = Layers(skeleton=True, curves=True, statistics=False)
    scene = view.scene(0.0, layers)
    views = [replace(scene, camera=replace(scene.camera, yaw=yaw)).framed(1.0) for yaw in yaws]
    return contact_sheet([render(each, size, size) for each in views], len(views))


def _radii(skeleton: Skeleton, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) metres, of each joint that is no end: no larger than its bone lets it be, so that fingers can be told."""
    lengths = np.linalg.norm(places - places[np.maximum(skeleton.parents, 0)], axis=1)
    lengths[skeleton.parents < 0] = np.inf
    return np.clip(0.2 * lengths, 0.004, 0.016)[~skeleton.is_end]


def curve_lines(mesh: Mesh, found: AutoRig, scale: float) -> list[Lines]:
    """The rings of the tubes that run around limbs, faint, and the limbs' middles."""
    parts = []
    around = [] if found.curves is None or found.tubes is None else round_tubes(mesh, found.curves, found.tubes)
    if found.curves is not None and around:
        rings = [found.curves.curve(int(number)) for number in np.concatenate(around)]
        segments = np.concatenate([np.stack([ring, np.roll(ring, -1)], axis=1) for ring in rings])
        parts.append(Lines(mesh.vertices * scale, segments, _RING, width=0.8, opacity=0.5))
    for line in found.lines.values():
        steps = np.arange(len(line.points) - 1)
        segments = np.stack([steps, steps + 1], axis=1).astype(np.int32)
        parts.append(Lines(line.points * scale, segments, _MIDDLE, width=1.6, through=0.5))
    return parts
