"""`sixpoint evaluate tables`."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import AsJson


def tables(
    data: Annotated[
        list[Path], typer.Option(help="Motion files of one skeleton, or folders of them; may be repeated.")
    ],
    out: Annotated[Path, typer.Option(help="The folder for tables, figure and databases.")] = Path("evaluation"),
    method: Annotated[
        list[str] | None, typer.Option(help="A method to run; may be repeated. All where left out.")
    ] = None,
    trackers: Annotated[str, typer.Option(help="Numbers of trackers, with commas between.")] = "2,3,4,5,6",
    clips: Annotated[int, typer.Option(min=1, help="Most held-out clips to solve of each action.")] = 4,
    seconds: Annotated[float, typer.Option(min=0.5, help="Seconds to solve of each clip.")] = 5.0,
    action: Annotated[
        str | None, typer.Option(help="Regular expression whose first group is the action in a file's name.")
    ] = None,
    mirror: Annotated[bool, typer.Option("--mirror", help="Add mirror images to the large database.")] = False,
    as_json: AsJson = False,
) -> None:
    """Repeat the reconstruction paper's experiment on your data: tables 1 and 2 and figure 3.

    Of each action's clips, sorted by name, every eighth is held out; the rest becomes the database, and every eighth
    clip of that a small one. Each method reconstructs the held-out clips from 2 to 6 of their own joints. Writes
    scores.csv, a CSV a table, tables.md and figure3.png. Databases are kept in the folder for the next run.

    Methods: gplvm, lpca, lpcr, nearest, mean-16, mean-16-ik, damped-ik, paper, default.
    """
    import json
    from contextlib import ExitStack
    from dataclasses import asdict

    from capture.evaluation import ACTION_PATTERN, METHODS, Plan, run_experiment
    from capture.evaluation_report import markdown, tables_of, write_report
    from capture.progress import progress_bar

    plan = Plan(tuple(method or METHODS), tracker_counts(trackers), clips, seconds, action or ACTION_PATTERN, mirror)
    with ExitStack() as bars:

        def stage(name: str):
            bars.close()
            return bars.enter_context(progress_bar(name))

        experiment = run_experiment(data, out, plan, stage)
    write_report(experiment, out)
    if not as_json:
        print(markdown(experiment), end="")
        return
    found = tables_of(experiment)
    print(
        json.dumps({n: [{"method": m, "column": c, **asdict(r)} for (m, c), r in t.items()] for n, t in found.items()})
    )


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
