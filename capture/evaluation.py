"""The reconstruction paper's own experiment on given data: errors by method, trackers, database size and action; and
the same with each action left out of the database in turn."""

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capture.evaluation_data import (
    ACTION_PATTERN,
    FPS,
    Clip,
    Split,
    by_action,
    evenly_chosen,
    find_clips,
    split_by_action,
    split_off,
)
from capture.evaluation_runs import METHODS, Run, Score, solve_runs
from devices.errors import SixpointError, choice_error
from devices.progress import Progress, no_progress
from reconstruction.database import MotionDatabase, build_database, open_database
from reconstruction.motion_files import read_motion

SMALL_SHARE = 8
"""The small database has every so many-th clip of the large one's."""

StageProgress = Callable[[str], Progress]
"""Gives the progress to report a named stage's steps to."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What is run. counts: numbers of trackers; clips: most held-out clips of an action; seconds: of each of them;
    mirror: whether large databases have mirror images too; jobs: processes at a time."""

    methods: tuple[str, ...] = METHODS
    counts: tuple[int, ...] = (2, 3, 4, 5, 6)
    clips: int = 4
    seconds: float = 5.0
    action_pattern: str = ACTION_PATTERN
    mirror: bool = False
    jobs: int = 1

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
    data: Sequence[Path], folder: Path, plan: Plan | None = None, stage: StageProgress | None = None
) -> Experiment:
    """Builds both databases into `folder` (or opens them where they stand from the same clips) and solves every run.

    data: motion files or folders of them. stage: gives a progress for each named stage. Raises FileError where the
    data have too few clips and SettingError for an unknown method.
    """
    plan, stage = plan or Plan(), stage or (lambda name: no_progress)
    _refuse_unknown(plan.methods)
    split = split_by_action(find_clips(data, plan.action_pattern))
    databases = {
        "large": kept_database(folder / "large", split.training, plan.mirror, stage("large database")),
        "small": kept_database(folder / "small", split.training[::SMALL_SHARE], False, stage("small database")),
    }
    clips = evenly_chosen(split.held_out, plan.clips)
    runs = [Run(method, n, name, databases[name].path, clips, plan.seconds) for name, n, method in plan.runs()]
    scores = solve_runs(runs, plan.jobs, stage("solving"))
    return Experiment(plan, split, {name: len(found) for name, found in databases.items()}, scores)


def run_without_actions(
    data: Sequence[Path],
    folder: Path,
    plan: Plan,
    actions: Sequence[str] = (),
    stage: StageProgress | None = None,
) -> tuple[Score, ...]:
    """Leaves each action (all where none is named) out of the database in turn and solves its clips.

    The databases are kept in `folder`. Raises FileError for an action that the data do not have, or where nothing is
    left without it, and SettingError for an unknown method.
    """
    stage = stage or (lambda name: no_progress)
    _refuse_unknown(plan.methods)
    clips = find_clips(data, plan.action_pattern)
    runs = []
    for action in actions or by_action(clips):
        split = split_off(clips, action)
        name = f"without {action}"
        path = kept_database(folder / name.replace(" ", "-"), split.training, plan.mirror, stage(name)).path
        held_out = evenly_chosen(split.held_out, plan.clips)
        runs += [Run(m, n, name, path, held_out, plan.seconds) for m in plan.methods for n in plan.counts]
    return solve_runs(runs, plan.jobs, stage("solving"))


def _refuse_unknown(methods: Sequence[str]) -> None:
    for method in methods:
        if method not in METHODS:
            raise choice_error("method", method, METHODS)


def mean_scores(scores: Iterable[Score], key: Callable[[Score], tuple]) -> dict[tuple, "Row"]:
    """The mean over clips of every group of scores with the same key."""
    groups: dict[tuple, list[Score]] = defaultdict(list)
    for score in scores:
        groups[key(score)].append(score)
    return {at: Row.mean(group) for at, group in groups.items()}


@dataclass(frozen=True, slots=True)
class Row:
    """Means over clips of one cell of a table, with the worst clip's euler_deg and mpjpe_cm.

    slide_ratio: centimetres a second that planted ankles slide, all clips together, over the truth's own; 0 where no
    foot is ever planted.
    """

    clips: int
    euler_deg: float
    mpjpe_cm: float
    tracked_cm: float
    jitter_ratio: float
    slide_ratio: float
    within_sigma: float
    solve_ms: float
    worst_deg: float
    worst_cm: float

    @classmethod
    def mean(cls, scores: Sequence[Score]) -> "Row":
        """Of the scores of one cell."""

        def each(name: str) -> list[float]:
            return [getattr(score.accuracy, name) for score in scores]

        own = float(np.sum(each("true_slide_cm_s")))
        return cls(
            clips=len(scores),
            euler_deg=float(np.mean(each("euler_deg"))),
            mpjpe_cm=float(np.mean(each("mpjpe_cm"))),
            tracked_cm=float(np.mean(each("tracked_cm"))),
            jitter_ratio=float(np.mean(each("jitter_ratio"))),
            slide_ratio=float(np.sum(each("slide_cm_s"))) / own if own else 0.0,
            within_sigma=float(np.mean([score.within_sigma for score in scores])),
            solve_ms=float(np.mean([score.solve_ms for score in scores])),
            worst_deg=max(each("euler_deg")),
            worst_cm=max(each("mpjpe_cm")),
        )


def kept_database(path: Path, clips: Sequence[Clip], mirror: bool, progress: Progress) -> MotionDatabase:
    """The database of these clips; one that stands there from the same clips is opened instead of built."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made_from = path.with_suffix(".json")
    files = [[str(clip.path.resolve()), clip.path.stat().st_size] for clip in clips]
    recipe = json.dumps({"files": files, "mirror": mirror, "fps": FPS})
    if path.is_dir() and made_from.is_file() and made_from.read_text() == recipe:
        try:
            return open_database(path)
        except SixpointError:
            pass  # of an older version, say: build it again
    built = build_database((read_motion(c.path) for c in clips), path, FPS, mirror, progress, count=len(clips))
    made_from.write_text(recipe)
    return built
