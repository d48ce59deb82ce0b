"""A solved take as something the window can play: any moment, forwards and back."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.characters import Cast
from capture.scene import Scene
from capture.stage import Stage
from capture.viewing import Layers
from deformation.deformer import DeformedMesh, DeformSettings
from deformation.live_deformer import LiveDeformer
from devices.frame import TrackerFrame
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Motion


@dataclass(frozen=True, eq=False)
class Performance:
    """What was solved. frames: (T,) the trackers, or empty; sigma: (T, J) radians and coverage: (T,), or None."""

    motion: Motion
    frames: Sequence[TrackerFrame] = ()
    sigma: NDArray[np.float64] | None = None
    coverage: NDArray[np.float64] | None = None


class PerformanceSource:
    """`FrameSource` over a performance: skins the frame that is asked for.

    Flesh that moves needs the frames between: going on by up to a quarter of a second plays them, a longer jump starts
    it anew.
    """

    def __init__(
        self, performance: Performance, cast: Cast, title: str = "", settings: DeformSettings | None = None
    ) -> None:
        self.performance, self.title = performance, title
        self.stage = Stage(performance.motion.skeleton, cast)
        self.deformer = LiveDeformer(cast.character, settings)
        self._joints = _all_joints(performance.motion)
        self._moving = self._joints if cast.retargeter is None else _all_joints(cast.motion(performance.motion))
        self._at: int | None = None
        self._skin: DeformedMesh | None = None

    @property
    def duration_s(self) -> float:
        """Seconds from the first pose to the last."""
        return self.performance.motion.duration_s

    @property
    def frame_s(self) -> float:
        """Seconds from pose to pose."""
        return 1 / self.performance.motion.fps

    def scene(self, time_s: float, layers: Layers) -> Scene:
        """The picture at that second."""
        p = self.performance
        frame = min(max(round(time_s * p.motion.fps), 0), len(p.motion) - 1)
        self._go_to(frame)
        trackers = p.frames[frame] if len(p.frames) else None
        sigma = None if p.sigma is None else p.sigma[frame]
        return self.stage.scene(
            time_s, trackers, self._joints[frame], self._skin, layers, sigma, self._status(frame), self.title
        )

    def scenes(self, fps: float, layers: Layers) -> Iterator[Scene]:
        """Every picture of a film at that rate."""
        for number in range(int(self.duration_s * fps) + 1):
            yield self.scene(number / fps, layers)

    def _go_to(self, frame: int) -> None:
        if frame == self._at:
            return
        near = self._at is not None and 0 < frame - self._at <= self.performance.motion.fps / 4
        if not near:
            self.deformer.reset()
            self.stage.cut()
        start = self._at + 1 if near and self._at is not None else frame
        for step in range(start, frame + 1):
            self._skin = self.deformer.deform(self._moving[step], self.frame_s)
        self._at = frame

    def _status(self, frame: int) -> list[str]:
        p = self.performance
        lines = []
        if len(p.frames):
            lines.append(f"trackers {int(p.frames[frame].measured.sum())} of 6")
        if p.coverage is not None:
            lines.append(f"coverage {p.coverage[frame]:.1f}  (about 1 inside the database)")
        return lines


def _all_joints(motion: Motion) -> NDArray[np.float64]:
    """(T, J, 4, 4) `T_world_joint` of every frame."""
    return world_transforms(motion.skeleton, motion.root_positions, motion.rotations)
