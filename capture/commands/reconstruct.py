"""`sixpoint reconstruct`: a whole take into poses, as fast as it goes."""

import json
import time
from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import AsJson, Database, Height, ProfileFile, Take
from devices.errors import FileError


def reconstruct(
    take: Take,
    out: Annotated[Path, typer.Option(help="The motion to write: .bvh, .glb, .csv or .npz.")],
    database: Database = "library",
    method: Annotated[
        str, typer.Option(help="`default`, or `paper`: the reconstruction paper to the letter.")
    ] = "default",
    height_m: Height = None,
    profile: ProfileFile = None,
    trackers: Annotated[str | None, typer.Option(help="Use only these roles, with commas between.")] = None,
    as_json: AsJson = False,
) -> None:
    """Solve a take: one pose a database frame period, from its first sample to its last."""
    from capture.export import motion_writer, write_motion
    from capture.library import open_named_database
    from capture.progress import progress_bar
    from capture.solving import solve_take

    motion_writer(out)
    if out.parent != Path() and not out.parent.is_dir():
        raise FileError(f"{out}: the folder {out.parent} does not exist")
    with progress_bar("opening the database") as progress:
        known = open_named_database(database, progress)
    begin = time.perf_counter()
    with progress_bar("solving") as progress:
        solved = solve_take(take, known, method, height_m, trackers, profile, progress)
    seconds = time.perf_counter() - begin
    write_motion(solved.motion, out)
    figures = solved.figures() | {"seconds": round(seconds, 3), "out": str(out)}
    print(json.dumps(figures) if as_json else _in_words(figures))


def _in_words(figures: dict) -> str:
    latency = figures["solve_ms"]
    speed = figures["duration_s"] / figures["seconds"] if figures["seconds"] else 0
    return (
        f"{figures['poses']} poses, {figures['duration_s']:.1f} s of motion in {figures['seconds']:.1f} s"
        f" ({speed:.1f} times real time)\n"
        f"solve p50 {latency['p50']:.2f}, p95 {latency['p95']:.2f}, p99 {latency['p99']:.2f},"
        f" max {latency['max']:.2f} ms; coverage {figures['coverage']:.2f}\n"
        f"wrote {figures['out']}"
    )
