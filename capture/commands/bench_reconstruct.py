"""`sixpoint bench reconstruct`."""

from dataclasses import replace
from typing import Annotated

import typer

from capture.commands.options import AsJson


def reconstruct(
    database: Annotated[
        list[str] | None,
        typer.Option(help="A folder of `database build`, or `library` (if left out); may be repeated."),
    ] = None,
    frames: Annotated[int, typer.Option(min=100, help="Frames to solve.")] = 1200,
    trackers: Annotated[str, typer.Option(help="The roles to solve from, with commas between.")] = "",
    method: Annotated[
        list[str] | None, typer.Option(help="A method to time; may be repeated. All where left out.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure how fast poses are solved, stage by stage, on noisy trackers on the database's own clips.

    Also all other methods' speed; the neighbour search and the paper's neighbour graph with their recall against an
    exact search; the same optimisation by SciPy's least squares; and, with several databases, how the time grows with
    their size. `processor` is what processors worked on a frame: on a busy machine it says more than the clock.

    Methods: gplvm, lpca, lpcr, nearest, mean-16, mean-16-ik, damped-ik, paper, default.
    """
    import json

    from capture.bench_reconstruct import BenchPlan, bench_reconstruct, growth
    from capture.library import open_named_database
    from capture.progress import progress_bar
    from devices.sample import ROLES

    plan = BenchPlan(frames=frames, roles=tuple(n.strip() for n in trackers.split(",")) if trackers else ROLES)
    if method:
        plan = replace(plan, methods=tuple(method))
    known, measured = [], []
    for name in database or ["library"]:
        with progress_bar(f"opening {name}") as progress:
            known.append(open_named_database(name, progress))
        with progress_bar(f"measuring on {len(known[-1])} poses") as progress:
            measured.append(bench_reconstruct(known[-1], plan, progress))
    together = growth(known, plan) if len(known) > 1 else {}
    if as_json:
        print(json.dumps({"databases": measured, "growth": together}))
        return
    for figures in measured:
        _print_table(figures, f"milliseconds, {figures['database']['poses']} poses")
    if together:
        _print_table(together, "milliseconds a frame, the databases in turns")


def _print_table(figures: dict, title: str) -> None:
    """The durations as a table, the other figures as lines."""
    from rich.console import Console

    from capture.latency import latency_table

    rows, lines = {}, []
    for part, values in figures.items():
        for name, value in values.items():
            if isinstance(value, dict) and "p95" in value:
                rows[f"{part}: {name}"] = value
            elif name == "stages_ms":
                rows |= {f"{part}: {stage}": row for stage, row in value.items()}
            else:
                lines.append(f"{part}: {name.replace('_', ' ')} {value}")
    console = Console()
    console.print(latency_table(rows, title))
    console.print("\n".join(lines))
