"""What `live` and `record` do: open, run until told to stop, close with everything kept, and say how it went."""

import gc
import json
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from capture.config import SessionConfig
from capture.latency import LatencyRecorder, latency_table
from capture.live import OpenDevice, make_pipeline, make_session, open_devices, open_streams, start_recording
from capture.pipeline import Shot
from capture.progress import progress_bar
from capture.reloading import reloading
from capture.session import Session
from capture.start_up import process_age_s
from capture.take_desk import TakeDesk, dated_take
from devices.errors import FileError, SixpointError
from replay_logs.atomic_file import check_file_place
from replay_logs.recorder import TakeRecorder

if TYPE_CHECKING:
    from capture.guide import CalibrationGuide


def tell(message: str) -> None:
    """A line to the person at the keyboard."""
    print(f"sixpoint: {message}", file=sys.stderr)


def go_live(
    config: SessionConfig,
    take: Path | None,
    seconds: float | None,
    window: bool,
    as_json: bool,
    source: Path | None = None,
) -> None:
    """A live session, in a window where there is a display; Ctrl-C, the window's end or `seconds` end it.

    source: the file that the configuration came of; when it is saved, what can change while live does.
    """
    from capture.viewer import has_display

    shown = window and has_display()
    if window and not shown:
        tell("no display here: solving without a window")
    session = solve_live(config, take, seconds, shown, source)
    _report(session.latencies, live_figures(session) | {"take": _name(take)}, as_json)


def live_figures(session: Session) -> dict[str, object]:
    """Poses solved and frames skipped, and how many seconds it took from the program's start to the first pose."""
    first = session.first_pose_ns
    start_s = None if first is None else round(process_age_s(first), 2)
    return {"poses": session.solved, "skipped": session.skipped, "start_to_first_pose_s": start_s}


def solve_live(
    config: SessionConfig,
    take: Path | None,
    seconds: float | None,
    shown: bool,
    source: Path | None = None,
    watchers: Sequence[Callable[[Shot], None]] = (),
) -> Session:
    """Runs a session to its end, recorded where a take is named; gives it back for its figures.

    watchers: called with each shot, besides the configured streams.
    """
    _check_take(take)
    with progress_bar("opening the database") as progress:
        pipeline = make_pipeline(config, progress)
    with progress_bar("loading kernels"):
        pipeline.warm_up()
        if shown:
            from capture.live_window import prepare_overlays

            prepare_overlays(pipeline)
    with (
        open_streams(config, pipeline) as streams,
        opened(config) as devices,
        _recording(take, config, devices) as recorder,
    ):
        session = make_session(config, devices, pipeline, recorder, [*streams, *watchers], tell)
        desk = TakeDesk(session, lambda path: start_recording(path, config, devices), Path(config.record.folder))
        with reloading(source, config, session.tuning, tell), _obeying(config, session, desk):
            run_session(session, seconds, shown, desk)
    return session


def keep(config: SessionConfig, take: Path | None, seconds: float | None, as_json: bool) -> None:
    """Records without solving; Ctrl-C or `seconds` end it."""
    take = take or _dated_take(Path(config.record.folder))
    session = keep_quietly(config, take, seconds)
    _report(session.latencies, {"samples": session.samples, "take": _name(take)}, as_json)


def keep_quietly(config: SessionConfig, take: Path, seconds: float | None) -> Session:
    """Records, and gives the session back for its figures."""
    _check_take(take)
    with opened(config) as devices, _recording(take, config, devices) as recorder:
        session = make_session(config, devices, None, recorder, tell=tell)
        run_session(session, seconds, shown=False)
    return session


def run_session(
    session: Session,
    seconds: float | None,
    shown: bool,
    desk: TakeDesk | None = None,
    guide: "CalibrationGuide | None" = None,
) -> None:
    """The session on a thread of its own; this one draws, or waits. A take begun meanwhile is finished.

    It ends with Ctrl-C, with its window, after `seconds`, or when the guide, where there is one, is through.
    """
    stop = threading.Event()
    failure: list[BaseException] = []

    def work() -> None:
        try:
            session.run(stop)
        except BaseException as error:
            failure.append(error)
        finally:
            stop.set()

    gc.collect()
    gc.freeze()  # what start-up has made stays, and need not be looked through in the middle of a frame
    thread = threading.Thread(target=work, name="session")
    thread.start()
    try:
        with _signals_end_it(stop):
            _watch(session, stop, seconds, shown, desk, guide)
    except KeyboardInterrupt:
        pass
    finally:
        stop.set()
        thread.join()
        gc.unfreeze()
        if session.recorder:
            session.recorder.close()
    if failure:
        raise failure[0]


@contextmanager
def _signals_end_it(stop: threading.Event) -> Iterator[None]:
    """A terminal that is closed or a `kill` ends the session in order, as Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    kinds = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {kind: signal.signal(kind, lambda *_: stop.set()) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def _watch(
    session: Session,
    stop: threading.Event,
    seconds: float | None,
    shown: bool,
    desk: TakeDesk | None,
    guide: "CalibrationGuide | None",
) -> None:
    end = None if seconds is None else time.monotonic() + seconds

    def ended() -> bool:
        through = guide is not None and guide.finished
        return through or stop.is_set() or (end is not None and time.monotonic() > end)

    if shown:
        from capture.live_window import show_session

        try:
            show_session(session, ended, desk, guide)
            return
        except SixpointError as error:
            # Who performs cannot see to it now, and what is recorded must not end with a picture.
            tell(f"{error}; the session goes on without it, Ctrl-C ends it")
    while not ended():
        if guide is not None:
            guide.tell_changes(tell)
        stop.wait(0.05)


@contextmanager
def _obeying(config: SessionConfig, session: Session, desk: TakeDesk) -> Iterator[None]:
    """Listens to what it is told over OSC, where a port is configured."""
    pipeline = session.pipeline
    if not config.show.osc_port or pipeline is None:
        yield
        return
    from capture.remote import listening, orders

    poke = pipeline.deformer.poke if pipeline.deformer else None
    with listening(orders(pipeline.director, session.tuning, desk, poke), config.show.osc_port, tell=tell):
        yield


@contextmanager
def opened(config: SessionConfig) -> Iterator[list[OpenDevice]]:
    """The configured devices, streaming until the block ends. Raises DeviceError and SettingError."""
    devices = open_devices(config.device, tell)
    try:
        yield devices
    finally:
        for device in devices:
            device.driver.close()


@contextmanager
def _recording(take: Path | None, config: SessionConfig, devices: list[OpenDevice]) -> Iterator[TakeRecorder | None]:
    if take is None:
        yield None
        return
    with start_recording(take, config, devices) as recorder:
        yield recorder


def _check_take(take: Path | None) -> None:
    """Before anything slow: whether the take can be made at all."""
    if take is None:
        return
    if take.suffix.lower() != ".mcap":
        raise FileError(f"{take}: a take ends in .mcap")
    if take.exists():
        raise FileError(f"{take}: there is a file already; takes are not overwritten")
    check_file_place(take)


def _dated_take(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return dated_take(folder)


def _name(take: Path | None) -> str | None:
    return None if take is None else str(take)


def _report(latencies: LatencyRecorder, figures: dict, as_json: bool) -> None:
    from rich.console import Console

    summary = latencies.summary()
    if as_json:
        print(json.dumps(figures | {"milliseconds": summary}))
        return
    if summary:
        Console().print(latency_table(summary))
    print(", ".join(f"{name} {value}" for name, value in figures.items() if value is not None))
