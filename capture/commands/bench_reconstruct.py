"""`sixpoint bench reconstruct`."""

from typing import Annotated

import typer

from capture.commands.options import AsJson


def reconstruct(
    database: Annotated[str, typer.Option(help="A folder of `database build`, or `library` for ours.")] = "library",
    frames: Annotated[int, typer.Option(min=100, help="Frames to solve.")] = 1200,
    trackers: Annotated[str, typer.Option(help="The roles to solve from, with commas between.")] = "",
    as_json: AsJson = False,
) -> None:
    """Measure how fast poses are solved, stage by stage, on noisy trackers on the database's own clips.

    Also the neighbour search with its recall, and the same optimisation by SciPy's least squares.
    """
    import json

    from capture.bench_reconstruct import BenchPlan, bench_reconstruct
    from capture.library import open_named_database
    from capture.progress import progress_bar
    from devices.sample import ROLES

    roles = tuple(name.strip() for name in trackers.split(",")) if trackers else ROLES
    with progress_bar("opening the database") as progress:
        known = open_named_database(database, progress)
    with progress_bar("solving") as progress:
        figures = bench_reconstruct(known, BenchPlan(frames=frames, roles=roles), progress)
    if as_json:
        print(json.dumps(figures))
        return
    _print_table(figures)


def _print_table(figures: dict) -> None:
    """The durations as a table, the other figures as lines."""
    from rich.console import Console

    from capture.latency import latency_table

    rows, lines = {}, []
    for part, values in figures.items():
        for name, value in values.items():
            if isinstance(value, dict) and "p99" in value:
                rows[f"{part}: {name}"] = value
            elif name == "stages_ms":
                rows |= {f"{part}: {stage}": row for stage, row in value.items()}
            else:
                lines.append(f"{part}: {name.replace('_', ' ')} {value}")
    console = Console()
    console.print(latency_table(rows))
    console.print("\n".join(lines))
