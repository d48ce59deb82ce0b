"""A solved take as something the window can play: any moment, forwards and back."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from capture.character_settings import character_settings
from capture.characters import Cast
from capture.figures_table import Rate, Refreshed, joined, latency_rows, standing_legend, tracker_rows
from capture.ghosts import Ghosts
from capture.latency import LatencyRecorder, percentiles_ms
from capture.panel import TuningPanel
from capture.scene import Scene, Timeline
from capture.stage import Stage
from capture.standings import Standings, StandingsWatch
from capture.tuning import Tuning
from capture.viewing import Action, Layers
from deformation.deformer import DeformedMesh, DeformSettings
from deformation.live_deformer import LiveDeformer
from devices.frame import TrackerFrame
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Motion
from reconstruction.solution import Reconstruction

_SWING_S = 2.0
"""So long after a change the flesh goes on moving, though the recording stands still."""
_MARK_S = 1.5
"""How long the text of a mark is shown."""


@dataclass(frozen=True, eq=False)
class Performance:
    """What is played.

    frames: (T,) the trackers, or empty; solved: what became of them, or None; ghosts: stands its neighbours, or None;
    marks: second and text of moments that were noted.
    """

    motion: Motion
    frames: Sequence[TrackerFrame] = ()
    solved: Reconstruction | None = None
    ghosts: Ghosts | None = None
    marks: tuple[tuple[float, str], ...] = ()

    @cached_property
    def standings(self) -> list[Standings]:
        """(T,) how the trackers were doing; empty without them."""
        if self.solved is None:
            return []
        watch = StandingsWatch()
        return [watch.seen(*seen) for seen in zip(self.frames, self.solved.states, strict=True)]


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
        self.tuning = Tuning(character_settings(self))
        self.panel = TuningPanel(self.tuning)
        self._joints = _all_joints(performance.motion)
        self._moving = self._joints if cast.retargeter is None else _all_joints(cast.motion(performance.motion))
        self._at: int | None = None
        self._skin: DeformedMesh | None = None
        self._swings_until = self._swung = 0.0
        self._latencies, self._rate, self._pictures = LatencyRecorder(600), Rate(), 0
        self._figures = Refreshed(self._figure_rows)

    @property
    def duration_s(self) -> float:
        """Seconds from the first pose to the last."""
        return self.performance.motion.duration_s

    @property
    def frame_s(self) -> float:
        """Seconds from pose to pose."""
        return 1 / self.performance.motion.fps

    @property
    def marks(self) -> tuple[float, ...]:
        """Seconds of the marks."""
        return tuple(second for second, _ in self.performance.marks)

    def scene(self, time_s: float, layers: Layers) -> Scene:
        """The picture at that second."""
        self._pictures += 1
        p, frame = self.performance, self.frame_at(time_s)
        if self.tuning.apply():
            self.swing()
        self._go_to(frame)
        standings = p.standings[frame] if p.standings else None
        scene = self.stage.scene(
            time_s,
            p.frames[frame] if len(p.frames) else None,
            self._joints[frame],
            self._skin,
            layers,
            p.solved.sigma[frame] if p.solved else None,
            self._status(time_s),
            self.title,
            standings,
            self._ghost_joints(frame) if layers.ghosts else None,
        )
        return replace(
            scene,
            figures=self._figures.rows() if layers.statistics else (),
            legend=standing_legend(standings) if standings and layers.trackers else (),
            panel=self.panel.panel(),
            timeline=Timeline(0.0, tuple(second / self.duration_s for second in self.marks)) if self.marks else None,
        )

    def scenes(self, fps: float, layers: Layers) -> Iterator[Scene]:
        """Every picture of a film at that rate."""
        for number in range(int(self.duration_s * fps) + 1):
            yield self.scene(number / fps, layers)

    def frame_at(self, time_s: float) -> int:
        """The frame that is shown at that second."""
        motion = self.performance.motion
        return min(max(round(time_s * motion.fps), 0), len(motion) - 1)

    def actions(self) -> Mapping[str, Action]:
        """The keys of a replay."""
        return {"P": Action("poke the flesh", self.poke), **self.panel.actions()}

    def poke(self) -> None:
        """Hits the flesh, to see it swing, also while the recording stands still."""
        self.deformer.poke()
        self.swing()

    def swing(self) -> None:
        """The flesh moves for a while, though the recording may stand still."""
        self._swings_until = time.monotonic() + _SWING_S

    def _go_to(self, frame: int) -> None:
        if frame == self._at:
            self._go_on_swinging(frame)
            return
        near = self._at is not None and 0 < frame - self._at <= self.performance.motion.fps / 4
        if not near:
            self.deformer.reset()
            self.stage.cut()
        start = self._at + 1 if near and self._at is not None else frame
        for step in range(start, frame + 1):
            self._deform(step, self.frame_s)
        self._at = frame

    def _go_on_swinging(self, frame: int) -> None:
        """Standing still, only what was poked or changed moves on."""
        now = time.monotonic()
        if now < self._swings_until or self.deformer.is_rebinding:
            self._deform(frame, min(now - self._swung, 1 / 30))
        self._swung = now

    def _deform(self, frame: int, elapsed_s: float) -> None:
        begin = time.perf_counter_ns()
        self._skin = self.deformer.deform(self._moving[frame], elapsed_s)
        self._latencies.add("skin", time.perf_counter_ns() - begin)

    def _ghost_joints(self, frame: int) -> NDArray[np.float64] | None:
        p = self.performance
        if p.ghosts is None or p.solved is None:
            return None
        return p.ghosts.joints(p.solved.neighbours[frame], p.solved.headings[frame])

    def _status(self, time_s: float) -> list[str]:
        return [text for second, text in self.performance.marks if 0 <= time_s - second < _MARK_S]

    def _figure_rows(self) -> tuple[str, ...]:
        p, frame = self.performance, self._at or 0
        replay = ["replay\tnow", f"pictures a second\t{self._rate.per_second(self._pictures):.1f}"]
        solving = {}
        if p.solved is not None:
            solving["solve"] = percentiles_ms(p.solved.milliseconds)
            replay.append(f"coverage\t{p.solved.coverage[frame]:.2f}")
        trackers = tracker_rows(p.standings[frame]) if p.standings else []
        return joined(latency_rows(solving | self._latencies.summary()), replay, trackers)


def _all_joints(motion: Motion) -> NDArray[np.float64]:
    """(T, J, 4, 4) `T_world_joint` of every frame."""
    return world_transforms(motion.skeleton, motion.root_positions, motion.rotations)
