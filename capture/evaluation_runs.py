"""Solving held-out clips by many methods, several processes at a time, and scoring what comes out."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from time import process_time

from capture.accuracy import Accuracy, accuracy, share_within_sigma
from capture.evaluation_data import Clip
from capture.workers import by_processes
from devices.errors import SixpointError
from devices.frame import TrackerFrame
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.baselines import BASELINES
from reconstruction.database import MotionDatabase, open_database
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_operations import leg_length
from reconstruction.paper_predictor import PaperPredictor
from reconstruction.prediction import Predictor
from reconstruction.skeleton import Skeleton
from reconstruction.solver import Reconstructor

METHODS = (*(name for name in BASELINES), "paper", "default")

TRACKER_SETS: dict[int, tuple[str, ...]] = {
    2: ("left_wrist", "right_ankle"),
    3: ("left_wrist", "left_ankle", "right_ankle"),
    4: ("left_wrist", "right_wrist", "left_ankle", "right_ankle"),
    5: ("root", "left_wrist", "right_wrist", "left_ankle", "right_ankle"),
    6: ROLES,
}
"""The paper's control points by their number (its section 5.2)."""


@dataclass(frozen=True, slots=True)
class Run:
    """One method, from one number of trackers, on one database, over some clips.

    name: of the database in the tables; database: its folder; seconds: most that are solved of each clip.
    """

    method: str
    trackers: int
    name: str
    database: Path
    clips: tuple[Clip, ...]
    seconds: float


@dataclass(frozen=True, slots=True)
class Score:
    """One clip solved once. database: the run's name of it; within_sigma: share of joints whose error is below the
    uncertainty they came with; solve_ms: processor milliseconds a frame, which do not depend on what else runs."""

    method: str
    trackers: int
    database: str
    clip: str
    action: str
    frames: int
    accuracy: Accuracy
    within_sigma: float
    solve_ms: float


def solve_runs(runs: Sequence[Run], jobs: int = 1, progress: Progress = no_progress) -> tuple[Score, ...]:
    """The scores of all runs, in their order, by that many processes at a time; progress counts clips.

    A run's clips are solved one after the other in one process, so that the scores do not depend on `jobs`.
    """
    total, done = sum(len(run.clips) for run in runs), 0
    jobs = min(jobs, len(runs))
    found: dict[int, list[Score]] = {}
    if jobs == 1:
        for number, run in enumerate(runs):
            found[number] = []
            for score in scores_of(run):
                found[number].append(score)
                done += 1
                progress(done, total)
    else:
        for number, scores in by_processes(_solved, list(enumerate(runs)), _lost, jobs):
            found[number] = scores
            done += len(scores)
            progress(done, total)
    return tuple(score for number in range(len(runs)) for score in found[number])


def scores_of(run: Run) -> Iterator[Score]:
    """One score a clip. One solver serves all clips on bodies of the same size."""
    database, roles = _opened(run.database), TRACKER_SETS[run.trackers]
    solvers: dict[bytes, Reconstructor] = {}
    for clip in run.clips:
        truth = _truth(clip, run.seconds)
        size = truth.skeleton.offsets.tobytes()
        if size not in solvers:
            predictor = predictor_of(run.method, database, truth.skeleton, roles)
            solvers[size] = Reconstructor(database, truth.skeleton, predictor=predictor)
        frames = tracker_frames(truth, roles)
        began = process_time()
        solved = solvers[size].solve_take(frames)
        solve_ms = 1000 * (process_time() - began) / len(frames)
        yield Score(
            run.method,
            run.trackers,
            run.name,
            clip.path.stem,
            clip.action,
            len(truth),
            accuracy(truth, solved.motion),
            share_within_sigma(truth, solved.motion, solved.sigma),
            solve_ms,
        )


def predictor_of(method: str, database: MotionDatabase, skeleton: Skeleton, roles: Sequence[str]) -> Predictor | None:
    """A method's prior for a performer of that skeleton, None for our own."""
    if method == "default":
        return None
    scale = leg_length(skeleton) / leg_length(database.space.skeleton)
    return PaperPredictor(database, scale) if method == "paper" else BASELINES[method](database, scale, roles)


def tracker_frames(motion: Motion, roles: Sequence[str]) -> list[TrackerFrame]:
    """What ideal trackers on those joints would have read, one frame a pose."""
    positions = world_joints(motion.skeleton, motion.root_positions, motion.rotations)[0]
    joints = {role: motion.skeleton.role_joint(role) for role in roles}
    return [
        TrackerFrame.from_positions(number / motion.fps, {role: now[joint] for role, joint in joints.items()})
        for number, now in enumerate(positions)
    ]


def _solved(job: tuple[int, Run]) -> tuple[int, list[Score]]:
    number, run = job
    return number, list(scores_of(run))


def _lost(job: tuple[int, Run], reason: str) -> tuple[int, list[Score]]:
    raise SixpointError(f"{job[1].method} with {job[1].trackers} trackers: {reason}")


@lru_cache(maxsize=2)
def _opened(path: Path) -> MotionDatabase:
    return open_database(path)


@lru_cache(maxsize=64)
def _truth(clip: Clip, seconds: float) -> Motion:
    return clip.middle(seconds)
