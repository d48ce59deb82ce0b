"""Makes the pictures of the window anew from the shipped take, with the window itself: needs a display.

`xvfb-run -s "-screen 0 1400x800x24" python docs/pictures/make_window_pictures.py`
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from capture.calibrating import CalibrationScript
from capture.characters import Cast, average_pose, cast
from capture.comparing import compared
from capture.demo_take import trackers_on
from capture.figures_table import standing_legend
from capture.ghosts import Ghosts
from capture.guide import CalibrationGuide
from capture.library import open_named_database
from capture.pipeline import Pipeline
from capture.playing import Performance, PerformanceSource
from capture.raster import contact_sheet
from capture.scene import Badge, Scene, beside_banner
from capture.side_by_side import SideBySideSource
from capture.solving import SolvedTake
from capture.stage import Stage
from capture.viewer import controlled, snapshot
from capture.viewing import Controls, Layers, Playback
from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.database import MotionDatabase
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_library import demo_motion
from reconstruction.solver import Reconstructor
from reconstruction.solver_settings import SolverSettings
from replay_logs.frames import load_frames

HERE = Path(__file__).parent
TAKE = HERE.parents[1] / "replay_logs" / "takes" / "demo.mcap"
SECONDS = 22.0
LARGE, SMALL = (1280, 720), (640, 360)
GAPS = {"left_wrist": (3.0, 3.4), "right_ankle": (5.6, 7.0), "left_wrist again": (4.0, 8.5)}
"""When trackers are taken away, to show what is seen of it."""
MOMENT_S = 6.4


def main() -> None:
    """Makes them all."""
    database = open_named_database()
    frames = [with_gaps(frame) for frame in load_frames(TAKE, database.fps)[: round(SECONDS * database.fps)]]
    mannequin = cast("mannequin", database.space.skeleton, "medium", average_pose(database, database.space.skeleton))
    source = solved_source(database, frames, mannequin)
    save(taken(source, MOMENT_S), "window.jpg")
    save(taken(source, 20.6, keys=("Tab", "Down", "Right", "Right")), "window_settings.jpg")
    source.panel.is_open = False
    save(
        contact_sheet([taken(source, 2.2, layers, ("+",), SMALL) for layers in LAYERS], columns=2),
        "window_layers.jpg",
    )
    save(side_by_side(database, frames, mannequin, source), "window_compare.jpg")
    save(calibration(database, mannequin), "window_calibration.jpg")


BARE = Layers(trackers=False, statistics=False)
LAYERS = (
    replace(BARE, trackers=True, skeleton=True),
    replace(BARE, skin=False, skeleton=True, ghosts=True),
    replace(BARE, curves=True),
    replace(BARE, lattice=True),
    replace(BARE, uncertainty=True),
    replace(BARE, paint="parts"),
)


def save(image: NDArray[np.uint8], name: str) -> None:
    """As JPEG: small, and without bands."""
    Image.fromarray(image).save(HERE / name, quality=90, optimize=True, subsampling=0)


def with_gaps(frame: TrackerFrame) -> TrackerFrame:
    """The frame without what is missing then."""
    gone = {name.split(" ")[0] for name, (begin, end) in GAPS.items() if begin <= frame.time_s < end}
    seen = {role: place for role, place in zip(ROLES, frame.positions, strict=True) if role not in gone}
    return TrackerFrame.from_positions(frame.time_s, seen)


def solved_source(
    database: MotionDatabase, frames: Sequence[TrackerFrame], mannequin: Cast, method: str = "default"
) -> PerformanceSource:
    """The take as it is played, with two marks."""
    solved = Reconstructor(database, settings=SolverSettings(method=method)).solve_take(frames)
    ghosts, marks = Ghosts(database, database.space.skeleton), ((5.0, "jog"), (16.0, "punches"))
    return PerformanceSource(Performance(solved.motion, frames, solved, ghosts, marks), mannequin, title="demo.mcap")


def taken(
    source: PerformanceSource | SideBySideSource,
    at_s: float,
    layers: Layers | None = None,
    keys: Sequence[str] = (),
    size: tuple[int, int] = LARGE,
) -> NDArray[np.uint8]:
    """What the window shows at a moment that was played up to, after these keys."""
    controls = Controls(Playback(source.duration_s, source.frame_s, source.marks), actions=source.actions())
    controls.layers = layers or controls.layers
    for key in keys:
        controls.press(key)
    shown = Scene()
    for frame in range(60, 0, -1):
        controls.playback.time_s = at_s - (frame - 1) * source.frame_s
        shown = source.scene(controls.playback.time_s, controls.layers)
        time.sleep(0.012)
    return snapshot(controlled(shown, controls), *size)


def side_by_side(
    database: MotionDatabase, frames: Sequence[TrackerFrame], mannequin: Cast, left: PerformanceSource
) -> NDArray[np.uint8]:
    """Our method and the paper's."""
    right = solved_source(database, frames, mannequin, "paper")
    solutions = [SolvedTake(list(frames), one.performance.solved) for one in (left, right) if one.performance.solved]
    comparison = compared("demo.mcap", *solutions)
    return taken(SideBySideSource(left, right, comparison, ("as it was recorded", "solver.method=paper")), MOMENT_S)


def calibration(database: MotionDatabase, mannequin: Cast) -> NDArray[np.uint8]:
    """A T-pose being held, and the result."""
    skeleton = database.space.skeleton
    pipeline, stage = Pipeline(Reconstructor(database), mannequin), Stage(skeleton, mannequin)
    guide = CalibrationGuide(database, 1.75, CalibrationScript())
    guide.banner()
    motion = after_t_pose(demo_motion(), 7.0)
    places = trackers_on(motion).positions
    pictures: list[NDArray[np.uint8]] = []
    frame = TrackerFrame.from_positions(0.0, {})
    for number in range(round(26 * motion.fps)):
        time_s = number / motion.fps
        frame = TrackerFrame.from_positions(time_s, dict(zip(ROLES, places[number], strict=True)))
        if abs(time_s - 4.2) < 0.5 / motion.fps:
            pictures.append(guided(guide, stage, pipeline, frame))
        guide.watch(SimpleNamespace(frame=frame))  # type: ignore[arg-type]
    while (banner := guide.banner()) is not None and banner.share is not None:
        guide.watch(SimpleNamespace(frame=frame))  # type: ignore[arg-type]
        time.sleep(0.05)
    pictures.append(guided(guide, stage, pipeline, frame))
    return contact_sheet(pictures, columns=2)


def guided(guide: CalibrationGuide, stage: Stage, pipeline: Pipeline, frame: TrackerFrame) -> NDArray[np.uint8]:
    """The performer beside what the guide says."""
    pipeline.reset()
    stage.cut()
    shot = pipeline.step(frame)
    for _ in range(30):
        shot = pipeline.step(frame)
    scene = stage.scene(
        0.0, frame, shot.joints, shot.skin, Layers(), title="sixpoint calibration", standings=shot.standings
    )
    legend, badge = standing_legend(shot.standings), Badge((0.16, 0.70, 0.42), "trackers: streaming")
    scene = replace(beside_banner(scene), banner=guide.banner(), badges=(badge,), legend=legend)
    return snapshot(controlled(scene, Controls(Playback(None))), 960, 540)


def after_t_pose(motion: Motion, seconds: float) -> Motion:
    """The motion after so long a T-pose."""
    count, skeleton = round(seconds * motion.fps), motion.skeleton
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), 1))
    lowest = world_joints(skeleton, np.zeros(3), rest)[0][:, 1].min()
    x, _, z = motion.root_positions[0]
    roots = np.vstack([np.tile([x, 0.02 - lowest, z], (count, 1)), motion.root_positions])
    rotations = np.concatenate([np.tile(rest, (count, 1, 1)), motion.rotations])
    return Motion(skeleton, roots, rotations, motion.fps, motion.name)


if __name__ == "__main__":
    main()
