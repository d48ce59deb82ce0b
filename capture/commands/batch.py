"""`sixpoint batch`: folders of takes, solved and scored by several processes or a cluster."""

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import AsJson, Database, Height, JointNames, ProfileFile
from devices.errors import FileError, SixpointError
from replay_logs.atomic_file import check_folder_place


def batch(
    paths: Annotated[list[Path], typer.Argument(help="Takes (.mcap) and tracks (.csv), or folders searched for them.")],
    out: Annotated[Path, typer.Option(help="The folder for motions, results.csv and summary.json.")],
    ending: Annotated[str, typer.Option(help="Of the motions: .bvh, .glb, .vrma, .csv or .npz.")] = ".bvh",
    score: Annotated[
        Path | None, typer.Option(help="A folder of the true motions (.bvh, .amc), called as the takes are.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; as many as there are cores otherwise.")] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="The scheduler of a Dask cluster: tcp://host:8786.")
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Solve what is solved already, too.")] = False,
    database: Database = "library",
    method: Annotated[str | None, typer.Option(help="`default`, or `paper`.")] = None,
    height_m: Height = None,
    profile: ProfileFile = None,
    trackers: Annotated[str | None, typer.Option(help="Use only these roles, with commas between.")] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--with", help="A setting to change, such as solver.noise_gain=0.")
    ] = None,
    joint_names: JointNames = "ours",
    as_json: AsJson = False,
) -> None:
    """Solve many takes, several at a time, and score them where the truth is known.

    Run again, it solves only what is new, changed or failed. A take that cannot be solved stops no other; the exit
    status is 2 then, and results.csv says why. On a cluster, all paths must be the same on every machine.
    """
    from capture.batch import failed, kept, planned, solve_job, write_results
    from capture.commands.reconstruct import check_changes
    from capture.export import motion_writer
    from capture.joint_presets import check_preset
    from capture.library import open_named_database
    from capture.progress import progress_bar
    from capture.workers import by_cluster, by_processes

    motion_writer(f"motion{ending}")
    check_changes(changes or [])
    if score is not None and not score.is_dir():
        raise FileError(f"{score}: no such folder")
    place = database if database == "library" else str(Path(database).resolve())
    given = {"database__path": place, "solver__method": method, "performer__height_m": height_m, "trackers": trackers}
    given["performer__profile"] = None if profile is None else _absolute(profile)
    check_folder_place(out)
    todo = planned(paths, out, score, ending, given, changes or [], check_preset(joint_names))
    done = {} if again else {job.take: before for job in todo if (before := kept(job))}
    left = [job for job in todo if job.take not in done]
    if left:
        with progress_bar("opening the database") as progress:
            open_named_database(database, progress)
    processes = min(jobs or os.cpu_count() or 1, max(1, len(left)))
    outcomes = by_cluster(solve_job, left, failed, dask) if dask else by_processes(solve_job, left, failed, processes)
    with progress_bar("takes") as progress:
        progress(0, len(left))
        for number, outcome in enumerate(outcomes, 1):
            done[outcome.take] = outcome
            progress(number, len(left))
    summary = write_results([done[job.take] for job in todo], out)
    print(json.dumps(summary) if as_json else _in_words(summary, out))
    if summary["failed"]:
        raise SixpointError(f"{summary['failed']} of {len(todo)} takes could not be solved; {out}/results.csv says why")


def _absolute(profile: Path) -> str:
    """A profile's file wherever it is read from; a performer's name as it is."""
    return str(profile.resolve()) if profile.exists() else str(profile)


def _in_words(summary: dict, out: Path) -> str:
    lines = [
        f"{summary['solved']} takes solved, {summary['kept']} were there, {summary['failed']} failed:"
        f" {summary['minutes']:.1f} minutes of motion"
    ]
    for name, row in summary["figures"].items():
        worst = f"most {row['worst']:>10.3f}  {Path(row['worst_take']).name}"
        lines.append(f"{name.replace('_', ' '):<16} mean {row['mean']:>9.3f}  {worst}")
    lines += [f"{Path(take).name}: {error}" for take, error in summary["failures"].items()]
    return "\n".join([*lines, f"wrote {out}/results.csv"])
