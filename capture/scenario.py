"""From a file to what can be played: a take is solved, a motion read."""

from pathlib import Path

from capture.characters import average_pose
from capture.library import open_named_database
from capture.playing import Performance
from capture.progress import progress_bar
from capture.solving import SolvedTake, solve_take
from reconstruction.motion import Pose
from reconstruction.motion_files import read_motion

TAKES = (".mcap", ".csv")


def performance_of(
    path: Path, database: str, height_m: float | None = None, profile: Path | None = None
) -> tuple[Performance, Pose]:
    """A take solved, or a motion read, and a pose of it that stands."""
    if path.suffix.lower() not in TAKES:
        motion = read_motion(path)
        return Performance(motion), motion.pose(0)
    with progress_bar("opening the database") as progress:
        known = open_named_database(database, progress)
    with progress_bar("solving") as progress:
        solved = solve_take(path, known, height_m=height_m, profile=profile, progress=progress)
    return performance(solved), average_pose(known, solved.motion.skeleton)


def performance(solved: SolvedTake) -> Performance:
    """A solved take as it is played."""
    r = solved.reconstruction
    return Performance(solved.motion, solved.frames, r.sigma, r.coverage)
