"""From a file to what can be played: a take is solved, a motion read."""

from dataclasses import dataclass
from pathlib import Path

from capture.characters import average_pose
from capture.ghosts import Ghosts
from capture.library import open_named_database
from capture.playing import Performance
from capture.progress import progress_bar
from capture.solve_settings import SolveSettings, recorded_settings
from capture.solving import SolvedTake, solve_with
from reconstruction.motion import Pose
from reconstruction.motion_files import read_motion
from replay_logs.span import Span
from replay_logs.take import read_take

TAKES = (".mcap", ".csv")


@dataclass(frozen=True, eq=False)
class Played:
    """A file as it is played. reference: a pose of the performer that stands; solved: the take's solution, or None."""

    performance: Performance
    reference: Pose
    solved: SolvedTake | None = None


def played(path: Path, settings: SolveSettings) -> Played:
    """A take solved with these settings, or a motion read. Raises FileError and SettingError."""
    if path.suffix.lower() not in TAKES:
        motion = read_motion(path)
        return Played(Performance(motion), motion.pose(0))
    with progress_bar("opening the database") as progress:
        known = open_named_database(settings.database, progress)
    with progress_bar("solving") as progress:
        solved = solve_with(path, known, settings, progress)
    skeleton = solved.motion.skeleton
    ghosts, marks = Ghosts(known, skeleton), marks_of(path, known.fps)
    performance = Performance(solved.motion, solved.frames, solved.reconstruction, ghosts, marks)
    return Played(performance, average_pose(known, skeleton), solved)


def said(path: Path, **options: object) -> SolveSettings:
    """What the session that recorded a take had said, and above it what the options say (`with_values`)."""
    recorded = recorded_settings(read_take(path)) if path.suffix.lower() == ".mcap" else SolveSettings()
    return recorded.with_values(**options)


def marks_of(path: Path, fps: float) -> tuple[tuple[float, str], ...]:
    """Second and text of each mark, from the first frame of a take on; none in other files."""
    if path.suffix.lower() != ".mcap":
        return ()
    take = read_take(path)
    readings, span = take.readings(), Span.of(take)
    if not take.marks or not readings:
        return ()
    start_ns = readings[0].host_time_ns
    if span is not None:
        start_ns = span.origin_ns + round(span.frames(fps)[0] / fps * 1e9)
    return tuple(((mark.time_ns - start_ns) * 1e-9, mark.text) for mark in take.marks)
