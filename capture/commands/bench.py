"""`sixpoint bench`: the speeds, measured here and now."""

import json
from typing import Annotated

import typer

from capture.commands.options import AsJson, Database


def deform(
    frames: Annotated[int, typer.Option(min=50, help="Frames to time at each size.")] = 600,
    volume: Annotated[bool, typer.Option("--volume", help="Instead: how volume is kept in hard poses.")] = False,
    as_json: AsJson = False,
) -> None:
    """Measure the deformation at the lattice paper's four sizes, stage by stage, beside its Table I."""
    from rich.console import Console

    from capture import deform_benchmark, volume_report
    from capture.progress import progress_bar

    with progress_bar("binding and deforming") as progress:
        if volume:
            rows = volume_report.mannequin_report()
        else:
            rows = deform_benchmark.benchmark(frames=frames, progress=progress)
    if as_json:
        print(json.dumps(rows))
    else:
        Console(width=150).print(volume_report.volume_table(rows) if volume else deform_benchmark.table(rows))


def rig(as_json: AsJson = False) -> None:
    """Measure curves, centres and beams at the rigging paper's two sizes, beside its Table 1."""
    from rich.console import Console

    from capture.rig_benchmark import benchmark, table

    rows = benchmark()
    if as_json:
        print(json.dumps(rows))
    else:
        Console(width=150).print(table(rows))


def live(
    seconds: Annotated[float, typer.Option(min=2, help="How long to run.")] = 60.0,
    database: Database = "library",
    resolution: Annotated[str, typer.Option(help="The mannequin's: low, medium or high.")] = "high",
    as_json: AsJson = False,
) -> None:
    """Run a whole session against a simulated device on a real pseudo-terminal, recording and streaming."""
    from capture.live_benchmark import bench_live

    bench_live(seconds, database, resolution, as_json)


def soak(
    seconds: Annotated[float, typer.Option(min=10, help="How long a session, on its own clock.")] = 3600.0,
    database: Database = "library",
    resolution: Annotated[str, typer.Option(help="The mannequin's: low, medium or high.")] = "low",
    as_json: AsJson = False,
) -> None:
    """Run a long session as fast as it goes, recorded and streamed: whether memory and latency stay flat."""
    from rich.console import Console

    from capture.live_benchmark import bench_config
    from capture.progress import progress_bar
    from capture.soak import figures, table
    from capture.soak import soak as run

    with progress_bar("soaking") as progress:
        parts = run(bench_config(database, resolution, 60.0), seconds, progress)
    if as_json:
        print(json.dumps(figures(parts)))
        return
    Console().print(table(parts))
    print(", ".join(f"{name} {value}" for name, value in figures(parts).items() if name != "parts"))
