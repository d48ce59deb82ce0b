"""`sixpoint evaluate tables` and `sixpoint evaluate actions`."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from capture.commands.options import AsJson
from capture.progress import stage_bars

if TYPE_CHECKING:
    from capture.evaluation import Plan


Data = Annotated[list[Path], typer.Option(help="Motion files of one skeleton, or folders of them; may be repeated.")]
Out = Annotated[Path, typer.Option(help="The folder for tables, figure and databases.")]
Trackers = Annotated[str, typer.Option(help="Numbers of trackers, with commas between.")]
Clips = Annotated[int, typer.Option(min=1, help="Most held-out clips to solve of each action.")]
Seconds = Annotated[float, typer.Option(min=0.5, help="Seconds to solve of each clip.")]
Action = Annotated[
    str | None, typer.Option(help="Regular expression whose first group is the action in a file's name.")
]
Mirror = Annotated[bool, typer.Option("--mirror", help="Add mirror images to the large database.")]
Jobs = Annotated[int, typer.Option(min=0, help="Processes to solve with; 0 is one a processor.")]


def tables(
    data: Data,
    out: Out = Path("evaluation"),
    method: Annotated[
        list[str] | None, typer.Option(help="A method to run; may be repeated. All where left out.")
    ] = None,
    trackers: Trackers = "2,3,4,5,6",
    clips: Clips = 4,
    seconds: Seconds = 5.0,
    action: Action = None,
    mirror: Mirror = False,
    jobs: Jobs = 0,
    as_json: AsJson = False,
) -> None:
    """Repeat the reconstruction paper's experiment on your data: tables 1 and 2 and figure 3.

    Of each action's clips, sorted by name, every eighth is held out; the rest becomes the database, and every eighth
    clip of that a small one. Each method reconstructs the held-out clips from 2 to 6 of their own joints. Writes
    scores.csv, a CSV a table, tables.md and figure3.png. Databases are kept in the folder for the next run.

    Methods: gplvm, lpca, lpcr, nearest, mean-16, mean-16-ik, damped-ik, paper, default.
    """
    import json
    from dataclasses import asdict

    from capture.evaluation import METHODS, run_experiment
    from capture.evaluation_report import markdown, tables_of, write_report

    plan = _plan(method or METHODS, trackers, clips, seconds, action, mirror, jobs)
    with stage_bars() as stage:
        experiment = run_experiment(data, out, plan, stage)
    write_report(experiment, out)
    if not as_json:
        print(markdown(experiment), end="")
        return
    found = tables_of(experiment)
    print(
        json.dumps({n: [{"method": m, "column": c, **asdict(r)} for (m, c), r in t.items()] for n, t in found.items()})
    )


def actions(
    data: Data,
    out: Out = Path("evaluation"),
    leave_out: Annotated[
        list[str] | None, typer.Option(help="An action to leave out; may be repeated. Each in turn where left out.")
    ] = None,
    method: Annotated[list[str] | None, typer.Option(help="A method to run; may be repeated.")] = None,
    trackers: Trackers = "6,4",
    clips: Clips = 4,
    seconds: Seconds = 5.0,
    action: Action = None,
    mirror: Mirror = False,
    jobs: Jobs = 0,
    as_json: AsJson = False,
) -> None:
    """Measure how poses are solved outside the data: each action is left out of the database, and its clips solved.

    Writes actions_scores.csv and actions.md. Databases are kept in the folder for the next run.

    Methods: gplvm, lpca, lpcr, nearest, mean-16, mean-16-ik, damped-ik, paper, default.
    """
    import json
    from dataclasses import asdict

    from capture.evaluation import mean_scores, run_without_actions
    from capture.evaluation_report import markdown_without_actions, write_without_actions

    plan = _plan(method or ("default",), trackers, clips, seconds, action, mirror, jobs)
    with stage_bars() as stage:
        scores = run_without_actions(data, out, plan, leave_out or (), stage)
    write_without_actions(scores, out)
    if not as_json:
        print(markdown_without_actions(scores), end="")
        return
    rows = mean_scores(scores, lambda s: (s.method, s.trackers, s.action))
    print(json.dumps([{"method": m, "trackers": n, "left_out": a, **asdict(row)} for (m, n, a), row in rows.items()]))


def _plan(
    methods: Sequence[str], trackers: str, clips: int, seconds: float, action: str | None, mirror: bool, jobs: int
) -> "Plan":
    from capture.evaluation import Plan
    from capture.evaluation_data import ACTION_PATTERN

    pattern = action or ACTION_PATTERN
    return Plan(tuple(methods), tracker_counts(trackers), clips, seconds, pattern, mirror, jobs or os.cpu_count() or 1)


def tracker_counts(text: str) -> tuple[int, ...]:
    """The numbers in `2,4,6`. Raises SettingError for anything but 2 to 6."""
    from devices.errors import SettingError

    try:
        counts = tuple(dict.fromkeys(int(word) for word in text.split(",")))
    except ValueError:
        raise SettingError(f"--trackers {text!r}: use numbers from 2 to 6 with commas between") from None
    if not counts or not all(2 <= count <= 6 for count in counts):
        raise SettingError(f"--trackers {text!r}: use numbers from 2 to 6 with commas between")
    return counts
