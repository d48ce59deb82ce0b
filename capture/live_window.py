"""The window over a running session: its newest shot, and how the session is doing."""

from collections.abc import Callable

from capture.scene import Camera, Scene
from capture.session import Session
from capture.stage import Stage
from capture.viewing import Action, Layers


class SessionSource:
    """`FrameSource` over a running session; it only ever looks at the newest shot."""

    duration_s = None

    def __init__(self, session: Session, stage: Stage) -> None:
        self.session, self.stage = session, stage
        self.frame_s = 1 / session.assembler.rate_hz

    def scene(self, time_s: float, layers: Layers) -> Scene:
        """The newest picture; the moment asked for means nothing while live."""
        shot = self.session.latest
        if shot is None:
            return Scene(camera=Camera(), title="waiting for trackers", status=tuple(self._devices()))
        status = [*self._devices(), *self._figures(), f"coverage {shot.solution.coverage:.1f}"]
        return self.stage.scene(
            shot.frame.time_s,
            shot.frame,
            shot.joints,
            shot.skin,
            layers,
            shot.solution.sigma,
            status,
            title="sixpoint live",
        )

    def _devices(self) -> list[str]:
        states = [(d.driver.name, getattr(d.driver, "state", None)) for d in self.session.devices]
        return [f"{name}: {state.value}" for name, state in states if state is not None]

    def _figures(self) -> list[str]:
        row = self.session.latencies.summary().get("whole frame")
        shown = [] if row is None else [f"frame {row['p50']:.1f} ms, p99 {row['p99']:.1f} ms"]
        if self.session.recorder:
            shown.append(f"recording {self.session.recorder.path.name}")
        return shown


def show_session(session: Session, ended: Callable[[], bool]) -> None:
    """A window over the session until it is closed, or `ended` says so."""
    from capture.viewer import show

    assert session.pipeline is not None
    stage = Stage(session.pipeline.reconstructor.skeleton, session.pipeline.cast)
    director = session.pipeline.director
    actions = {"C": Action("the clip, or the performer", director.toggle_clip)} if director else {}
    show(SessionSource(session, stage), title="sixpoint live", actions=actions, until=ended)
