"""The reconstruction paper's own experiment on given data: errors by method, trackers, database size and action.

Clips are held out by a fixed rule: of each action's clips, sorted by name, every `HOLD_OUT`-th from the middle of the
first stretch on, and the middle one where there are fewer; the rest is the database.
"""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from capture.accuracy import Accuracy, accuracy
from devices.errors import FileError, SixpointError, choice_error
from devices.frame import TrackerFrame
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.baselines import BASELINES
from reconstruction.database import MotionDatabase, build_database, open_database
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_files import MOTION_ENDINGS, read_motion
from reconstruction.motion_operations import cropped, leg_length, resampled
from reconstruction.paper_predictor import PaperPredictor
from reconstruction.prediction import Predictor
from reconstruction.solver import SolverSettings, reconstruct

FPS = 60.0
HOLD_OUT = 8
SMALL_SHARE = 8
"""The small database has every so many-th clip of the large one's."""

TRACKER_SETS: dict[int, tuple[str, ...]] = {
    2: ("left_wrist", "right_ankle"),
    3: ("left_wrist", "left_ankle", "right_ankle"),
    4: ("left_wrist", "right_wrist", "left_ankle", "right_ankle"),
    5: ("root", "left_wrist", "right_wrist", "left_ankle", "right_ankle"),
    6: ROLES,
}
"""The paper's control points by their number (its section 5.2)."""

METHODS = (*(name for name in BASELINES), "paper", "default")
ACTION_PATTERN = r"(?:cmu_(?:train|test)_|dataset-\d+_)?([A-Za-z]+(?:-[A-Za-z]+)*)"
"""What of a file's name is its action: by default its first word, data set prefixes left out."""


@dataclass(frozen=True, slots=True)
class Clip:
    """One file of the data: where it is, and what is done in it."""

    path: Path
    action: str


@dataclass(frozen=True, slots=True)
class Split:
    """The data parted: clips of the database, and those held out."""

    training: tuple[Clip, ...]
    held_out: tuple[Clip, ...]


@dataclass(frozen=True, slots=True)
class Score:
    """One clip solved once. database: "large" or "small"; solve_ms: the median of its frames."""

    method: str
    trackers: int
    database: str
    clip: str
    action: str
    frames: int
    accuracy: Accuracy
    solve_ms: float


@dataclass(frozen=True, slots=True)
class Plan:
    """What is run. counts: numbers of trackers; clips: most held-out clips of an action; seconds: of each of them."""

    methods: tuple[str, ...] = METHODS
    counts: tuple[int, ...] = (2, 3, 4, 5, 6)
    clips: int = 4
    seconds: float = 5.0
    action_pattern: str = ACTION_PATTERN
    mirror: bool = False

    def runs(self) -> list[tuple[str, int, str]]:
        """(database, trackers, method): all counts on the large database, six trackers on the small one."""
        large = [("large", count, method) for count in self.counts for method in self.methods]
        return large + [("small", 6, method) for method in self.methods if 6 in self.counts]


@dataclass(frozen=True)
class Experiment:
    """What came out. poses: of each database; scores: one a clip and run."""

    plan: Plan
    split: Split
    poses: dict[str, int]
    scores: tuple[Score, ...]


def run_experiment(
    data: Sequence[Path], folder: Path, plan: Plan | None = None, stage: "StageProgress | None" = None
) -> Experiment:
    """Builds both databases into `folder` (or opens them where they stand from the same clips) and solves every run.

    data: motion files or folders of them. stage: gives a progress for each named stage. Raises FileError where the
    data have too few clips and SettingError for an unknown method.
    """
    plan, stage = plan or Plan(), stage or (lambda name: no_progress)
    for method in plan.methods:
        if method not in METHODS:
            raise choice_error("method", method, METHODS)
    split = split_by_action(find_clips(data, plan.action_pattern))
    databases = {
        "large": _database(folder / "large", split.training, plan.mirror, stage("large database")),
        "small": _database(folder / "small", split.training[::SMALL_SHARE], False, stage("small database")),
    }
    cases = _cases(split, plan)
    runs, progress = plan.runs(), stage("solving")
    scores: list[Score] = []
    for name, count, method in runs:
        predictor: Predictor | None = None
        for clip, truth in cases:
            predictor = predictor or _predictor(method, databases[name], truth, TRACKER_SETS[count])
            scores.append(_scored(method, count, name, databases[name], predictor, clip, truth))
            progress(len(scores), len(runs) * len(cases))
    return Experiment(plan, split, {name: len(found) for name, found in databases.items()}, tuple(scores))


StageProgress = Callable[[str], Progress]
"""Gives the progress to report a named stage's steps to."""


def find_clips(data: Sequence[Path], action_pattern: str = ACTION_PATTERN) -> list[Clip]:
    """Motion files and all those in folders, sorted, each with its action. Raises FileError for a missing path."""
    found: list[Clip] = []
    for path in data:
        if not path.exists():
            raise FileError(f"{path}: no such file or folder")
        files = [f for f in path.rglob("*") if f.suffix.lower() in MOTION_ENDINGS] if path.is_dir() else [path]
        found += [Clip(file, _action(file, action_pattern)) for file in sorted(files)]
    return found


def split_by_action(clips: Sequence[Clip]) -> Split:
    """Holds clips out by the rule of this module. Raises FileError where nothing would be left to learn from."""
    by_action: dict[str, list[Clip]] = defaultdict(list)
    for clip in clips:
        by_action[clip.action].append(clip)
    held = []
    for same in by_action.values():
        if len(same) > 1:
            held += same[min(HOLD_OUT, len(same)) // 2 :: HOLD_OUT]
    training = [clip for clip in clips if clip not in held]
    if not held or not training:
        raise FileError(f"{len(clips)} motions found; an experiment needs two of one action at least")
    return Split(tuple(training), tuple(held))


def tracker_frames(motion: Motion, roles: Sequence[str]) -> list[TrackerFrame]:
    """What ideal trackers on those joints would have read, one frame a pose."""
    positions = world_joints(motion.skeleton, motion.root_positions, motion.rotations)[0]
    joints = {role: motion.skeleton.role_joint(role) for role in roles}
    return [
        TrackerFrame.from_positions(number / motion.fps, {role: now[joint] for role, joint in joints.items()})
        for number, now in enumerate(positions)
    ]


def mean_scores(scores: Iterable[Score], key: Callable[[Score], tuple]) -> dict[tuple, "Row"]:
    """The mean over clips of every group of scores with the same key."""
    groups: dict[tuple, list[Score]] = defaultdict(list)
    for score in scores:
        groups[key(score)].append(score)
    return {at: Row.mean(group) for at, group in groups.items()}


@dataclass(frozen=True, slots=True)
class Row:
    """Means over clips of one cell of a table, with the worst clip's euler_deg and mpjpe_cm."""

    clips: int
    euler_deg: float
    mpjpe_cm: float
    jitter_ratio: float
    solve_ms: float
    worst_deg: float
    worst_cm: float

    @classmethod
    def mean(cls, scores: Sequence[Score]) -> "Row":
        """Of the scores of one cell."""
        degrees, centimetres = ([getattr(s.accuracy, name) for s in scores] for name in ("euler_deg", "mpjpe_cm"))
        jitter = float(np.mean([s.accuracy.jitter_ratio for s in scores]))
        milliseconds = float(np.mean([s.solve_ms for s in scores]))
        means = float(np.mean(degrees)), float(np.mean(centimetres))
        return cls(len(scores), *means, jitter, milliseconds, max(degrees), max(centimetres))


def _action(file: Path, pattern: str) -> str:
    try:
        found = re.match(pattern, file.stem)
    except re.error as error:
        raise FileError(f"--action {pattern!r}: not a regular expression ({error})") from None
    return (found[1] if found and found.re.groups else file.stem).lower()


def _database(path: Path, clips: Sequence[Clip], mirror: bool, progress: Progress) -> MotionDatabase:
    """The database of these clips; one that stands there from the same clips is opened instead of built."""
    made_from = path.with_suffix(".json")
    recipe = json.dumps({"files": [str(clip.path.resolve()) for clip in clips], "mirror": mirror, "fps": FPS})
    if path.is_dir() and made_from.is_file() and made_from.read_text() == recipe:
        try:
            return open_database(path)
        except SixpointError:
            pass  # of an older version, say: build it again
    built = build_database((read_motion(c.path) for c in clips), path, FPS, mirror, progress, count=len(clips))
    made_from.write_text(recipe)
    return built


def _cases(split: Split, plan: Plan) -> list[tuple[Clip, Motion]]:
    """The held-out clips that are solved, evenly chosen where there are more than asked for, from their middles."""
    by_action: dict[str, list[Clip]] = defaultdict(list)
    for clip in split.held_out:
        by_action[clip.action].append(clip)
    cases = []
    for same in by_action.values():
        chosen = np.unique(np.linspace(0, len(same) - 1, min(plan.clips, len(same))).round().astype(int))
        for clip in (same[i] for i in chosen):
            motion = resampled(read_motion(clip.path), FPS)
            length = min(len(motion), round(plan.seconds * FPS))
            start = (len(motion) - length) // 2
            cases.append((clip, replace(cropped(motion, start, start + length), name=clip.path.stem)))
    return cases


def _predictor(method: str, database: MotionDatabase, truth: Motion, roles: Sequence[str]) -> Predictor | None:
    """The method's prior, None for our own."""
    scale = leg_length(truth.skeleton) / leg_length(database.space.skeleton)
    if method == "default":
        return None
    return PaperPredictor(database, scale) if method == "paper" else BASELINES[method](database, scale, roles)


def _scored(
    method: str,
    count: int,
    name: str,
    database: MotionDatabase,
    predictor: Predictor | None,
    clip: Clip,
    truth: Motion,
) -> Score:
    frames = tracker_frames(truth, TRACKER_SETS[count])
    solved = reconstruct(frames, database, truth.skeleton, SolverSettings(), predictor=predictor)
    errors = accuracy(truth, solved.motion)
    milliseconds = float(np.median(solved.milliseconds))
    return Score(method, count, name, clip.path.stem, clip.action, len(truth), errors, milliseconds)
