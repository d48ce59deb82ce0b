"""The window over a running session: its newest shot, and how the session is doing."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from capture.curve_marks import curve_strokes
from capture.figures_table import Rate, Refreshed, joined, latency_rows, standing_legend, tracker_rows
from capture.ghosts import Ghosts
from capture.guide import CalibrationGuide
from capture.panel import TuningPanel
from capture.pipeline import Pipeline
from capture.scene import Badge, Camera, Colour, Scene, beside_banner
from capture.session import Session
from capture.stage import Stage
from capture.take_desk import TakeDesk
from capture.viewing import Action, Layers
from devices.reconnecting import DeviceState

_STATE_COLOURS: Mapping[DeviceState, Colour] = {
    DeviceState.STREAMING: (0.16, 0.70, 0.42),
    DeviceState.SILENT: (0.98, 0.66, 0.14),
    DeviceState.GONE: (0.85, 0.22, 0.20),
}


class SessionSource:
    """`FrameSource` over a running session; it only ever looks at the newest shot."""

    duration_s = None

    def __init__(
        self,
        session: Session,
        pipeline: Pipeline,
        desk: TakeDesk | None = None,
        guide: CalibrationGuide | None = None,
    ) -> None:
        self.session, self.desk, self.guide = session, desk, guide
        self.stage = Stage(pipeline.reconstructor.skeleton, pipeline.cast)
        self.panel = TuningPanel(session.tuning)
        self.frame_s = 1 / session.assembler.rate_hz
        self._ghosts = Ghosts(pipeline.reconstructor.database, pipeline.reconstructor.skeleton)
        self._pictures = 0
        self._poses_rate, self._picture_rate = Rate(), Rate()
        self._figures = Refreshed(self._figure_rows)

    def scene(self, time_s: float, layers: Layers) -> Scene:
        """The newest picture; the moment asked for means nothing while live."""
        self._pictures += 1
        shot = self.session.latest
        if shot is None:
            return replace(Scene(camera=Camera(), title="waiting for trackers"), badges=self._badges())
        solution = shot.solution
        ghosts = self._ghosts.joints(solution.neighbours, solution.heading) if layers.ghosts else None
        scene = self.stage.scene(
            shot.frame.time_s,
            shot.frame,
            shot.joints,
            shot.skin,
            layers,
            solution.sigma,
            title="sixpoint calibration" if self.guide else "sixpoint live",
            standings=shot.standings,
            ghosts=ghosts,
        )
        scene = replace(
            scene,
            badges=self._badges(),
            figures=self._figures.rows() if layers.statistics and not self.guide else (),
            legend=standing_legend(shot.standings) if layers.trackers else (),
            panel=self.panel.panel(),
        )
        if self.guide is None or self.guide.finished:
            return scene
        return replace(beside_banner(scene), banner=self.guide.banner(), panel=None)

    def _badges(self) -> tuple[Badge, ...]:
        states = [(d.driver.name, getattr(d.driver, "state", None)) for d in self.session.devices]
        devices = [Badge(_STATE_COLOURS[state], f"{name}: {state.value}") for name, state in states if state]
        return (*devices, *(self.desk.badges() if self.desk else ()))

    def _figure_rows(self) -> tuple[str, ...]:
        session, shot = self.session, self.session.latest
        rates = [
            "session\tnow",
            f"poses a second\t{self._poses_rate.per_second(session.solved):.1f}",
            f"pictures a second\t{self._picture_rate.per_second(self._pictures):.1f}",
            f"frames skipped\t{session.skipped}",
        ]
        if shot is None:
            return joined(latency_rows(session.latencies.summary()), rates)
        rates.append(f"coverage\t{shot.solution.coverage:.2f}")
        return joined(latency_rows(session.latencies.summary()), rates, tracker_rows(shot.standings))


def session_actions(source: SessionSource, pipeline: Pipeline) -> Mapping[str, Action]:
    """The keys of a session: takes, settings, what is shown."""
    director = pipeline.director
    clip = {"C": Action("the clip, or the performer", director.toggle_clip)} if director else {}
    poke = {"P": Action("poke the flesh", pipeline.deformer.poke)} if pipeline.deformer else {}
    takes = source.desk.actions() if source.desk else {}
    guide = source.guide.actions() if source.guide else {}
    return {**takes, **clip, **poke, **source.panel.actions(), **guide}


def prepare_overlays(pipeline: Pipeline) -> None:
    """Has made what overlays are drawn of, so that no key holds up the session while a kernel is compiled."""
    if pipeline.cast is not None:
        curve_strokes(pipeline.cast.character.mesh)
    reconstructor = pipeline.reconstructor
    Ghosts(reconstructor.database, reconstructor.skeleton).joints(np.ones(2, np.int64), np.zeros(3))


def show_session(
    session: Session,
    ended: Callable[[], bool],
    desk: TakeDesk | None = None,
    guide: CalibrationGuide | None = None,
) -> None:
    """A window over the session until it is closed, or `ended` says so."""
    from capture.viewer import show

    pipeline = session.pipeline
    assert pipeline is not None
    source = SessionSource(session, pipeline, desk, guide)
    show(source, title="sixpoint live", actions=session_actions(source, pipeline), until=ended)
