"""What `sixpoint demo` does: the shipped take, end to end, seen in a window or kept as files."""

import json
import sys
from collections.abc import Iterator
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from capture.characters import Cast, average_pose, cast
from capture.export import write_glb, write_motion
from capture.ghosts import Ghosts
from capture.latency import LatencyRecorder, latency_table
from capture.library import open_named_database
from capture.pipeline import Pipeline
from capture.playing import Performance, PerformanceSource
from capture.progress import progress_bar
from capture.raster import render
from capture.video import write_frames, write_video
from capture.viewer import has_display, show
from capture.viewing import Layers
from devices.errors import SixpointError
from devices.frame import TrackerFrame
from reconstruction.database import MotionDatabase
from reconstruction.solution import Reconstruction
from reconstruction.solver import Reconstructor
from replay_logs.atomic_file import check_folder_place
from replay_logs.frames import load_frames

DEMO_TAKE = "demo.mcap"
_OUT = Path("sixpoint_demo")
_PICTURE = (640, 360)
_FILM_FPS = 12.0


def run_demo(out: Path | None, resolution: str, window: bool, seconds: float | None, as_json: bool) -> None:
    """The demo. Files are written where `out` is given or there is no window to look at."""
    check_folder_place(out or _OUT)
    with progress_bar("opening the motion library") as progress:
        database = open_named_database(progress=progress)
    frames = _frames(database, seconds)
    skeleton = database.space.skeleton
    mannequin = cast("mannequin", skeleton, resolution, average_pose(database, skeleton))
    latencies = LatencyRecorder(len(frames))
    performance = perform(frames, database, mannequin, latencies)
    shown = window and _show(performance, mannequin)
    if out is not None or not shown:
        folder = out or _OUT
        folder.mkdir(parents=True, exist_ok=True)
        _write(folder, performance, mannequin, latencies, pictures=not shown)
    _report(latencies, as_json)


def perform(
    frames: list[TrackerFrame], database: MotionDatabase, mannequin: Cast, latencies: LatencyRecorder
) -> Performance:
    """Every frame through the whole pipeline, skin included, with its latencies."""
    pipeline = Pipeline(Reconstructor(database), mannequin)
    solutions = []
    with progress_bar("loading kernels"):
        pipeline.warm_up()
    with progress_bar("solving and skinning") as progress:
        for number, frame in enumerate(frames, 1):
            shot = pipeline.step(frame)
            solutions.append(shot.solution)
            latencies.add_all(shot.stages_ns)
            progress(number, len(frames))
    skeleton = pipeline.reconstructor.skeleton
    solved = Reconstruction.of(solutions, skeleton, database.fps, "demo")
    return Performance(solved.motion, frames, solved, Ghosts(database, skeleton))


def _frames(database: MotionDatabase, seconds: float | None) -> list[TrackerFrame]:
    with as_file(files("replay_logs.takes").joinpath(DEMO_TAKE)) as take:
        frames = load_frames(take, database.fps)
    return frames if seconds is None else frames[: max(2, round(seconds * database.fps))]


def _show(performance: Performance, mannequin: Cast) -> bool:
    """The window, where one can be opened; says why not where it should have been."""
    if not has_display():
        return False
    try:
        source = PerformanceSource(performance, mannequin, "sixpoint demo")
        show(source, title="sixpoint demo", actions=source.actions())
    except SixpointError as error:
        print(f"sixpoint: {error}; writing files instead", file=sys.stderr)
        return False
    return True


def _write(folder: Path, performance: Performance, mannequin: Cast, latencies: LatencyRecorder, pictures: bool) -> None:
    write_motion(performance.motion, folder / "pose.bvh")
    write_glb(mannequin.character, performance.motion, folder / "character.glb")
    (folder / "latency.json").write_text(json.dumps(latencies.summary(), indent=1) + "\n")
    if pictures:
        images = list(_pictures(performance, mannequin))
        write_frames(images, folder / "frames")
        write_video(images, folder / "demo.gif", _FILM_FPS)
    print(f"wrote {folder}/: {', '.join(sorted(path.name for path in folder.iterdir()))}", file=sys.stderr)


def _pictures(performance: Performance, mannequin: Cast) -> Iterator[np.ndarray]:
    source = PerformanceSource(performance, mannequin, "sixpoint demo")
    total = int(source.duration_s * _FILM_FPS) + 1
    with progress_bar("drawing") as progress:
        for number, scene in enumerate(source.scenes(_FILM_FPS, Layers(statistics=False)), 1):
            yield render(scene, *_PICTURE)
            progress(number, total)


def _report(latencies: LatencyRecorder, as_json: bool) -> None:
    if as_json:
        print(json.dumps(latencies.summary()))
        return
    from rich.console import Console

    Console().print(latency_table(latencies.summary(), "milliseconds a frame, trackers in to vertices out"))
