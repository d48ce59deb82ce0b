"""`sixpoint take`: what is in takes, and parts, sums and other forms of them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from capture.commands.options import AsJson
from devices.errors import choice_error
from devices.progress import Progress
from replay_logs.atomic_file import check_file_place

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from replay_logs.summary import TakeSummary
    from replay_logs.take import Take

_COLUMNS = 36

Recorded = Annotated[Path, typer.Argument(help="A take (.mcap).")]
NewTake = Annotated[Path, typer.Argument(help="The take to make (.mcap).")]


def info(
    take: Recorded,
    picture: Annotated[Path | None, typer.Option(help="Draw when each tracker was seen, into this .png.")] = None,
    database: Annotated[
        str | None, typer.Option(help="Solve the take with this database, and draw how well it knew the movement.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Tell what is in a take: devices, trackers, rates, losses, dropouts, marks and the session's settings."""
    from capture.solve_settings import recorded_settings
    from capture.take_picture import draw_take
    from replay_logs.summary import summarised
    from replay_logs.take import read_take

    if picture is not None:
        _check_place(picture, (".png",))
    held = read_take(take)
    summary = summarised(held)
    settings = recorded_settings(held).session.model_dump(exclude_unset=True)
    figures = summary.figures() | {"session": settings}
    coverage = None
    if database is not None:
        coverage = _coverage(take, database)
        figures["coverage"] = round(float(coverage.mean()), 3)
    if picture is not None:
        draw_take(summary, picture, coverage)
        figures["picture"] = str(picture)
    if as_json:
        print(json.dumps(figures))
    else:
        _print(summary, figures)


def trim(
    take: Recorded,
    out: NewTake,
    start: Annotated[
        float | None, typer.Option("--from", min=0, help="Second at which it begins, from the first reading.")
    ] = None,
    end: Annotated[float | None, typer.Option("--to", min=0, help="Second at which it ends.")] = None,
) -> None:
    """Keep a part of a take.

    Its frames are those of the whole take to the last bit. For that it holds some bytes from before and after, which do
    not count and are not shown: what a tracker's clock, gate and filter make of a byte depends on those before.
    """
    from replay_logs.rewriting import write_take
    from replay_logs.take import read_take
    from replay_logs.trimming import trimmed

    _check_place(out, (".mcap",))
    part = trimmed(_told(read_take(take)), start, end)
    _with_bar("writing", lambda progress: write_take(part.take, out, progress))
    print(f"{part.span.seconds:.2f} s, with {part.lead_in_s:.2f} s of bytes from before, in {out}")


def merge(
    a: Annotated[Path, typer.Argument(help="A take (.mcap), whose clock counts.")],
    b: Annotated[Path, typer.Argument(help="Another.")],
    out: NewTake,
    order: Annotated[
        str, typer.Option(help="parallel: at the same time; after: one after the other; auto: as they overlap.")
    ] = "auto",
    offset_s: Annotated[
        float | None, typer.Option(help="So long after the first does the second begin, whatever their clocks say.")
    ] = None,
) -> None:
    """Make one take of two: devices that were recorded apart, or a performance in two parts.

    Takes of one machine's run share its clock. Others are matched by the time of day, which is good to about a second;
    --offset-s says it better. How it was done is printed and kept in the take.
    """
    from replay_logs.merging import merged
    from replay_logs.rewriting import write_take
    from replay_logs.take import read_take

    _check_place(out, (".mcap",))
    both = merged(_told(read_take(a)), _told(read_take(b)), order, offset_s)
    _with_bar("writing", lambda progress: write_take(both.take, out, progress))
    print(f"{both.told}\n{both.take.duration_s:.2f} s of {len(both.take.devices)} devices in {out}")


def convert(
    take: Annotated[Path, typer.Argument(help="A take (.mcap), or tracks (.csv).")],
    out: Annotated[Path, typer.Argument(help="What to write: tracks .csv, arrays .npz, or a take .mcap.")],
) -> None:
    """Write a take as tracks or arrays, tracks as a take, or a damaged take whole up to its damage.

    Tracks and arrays are what the solver is given: roles, in the world, outliers out, smoothed where it was asked for.
    """
    from replay_logs.converting import csv_to_take, take_to_csv, take_to_npz
    from replay_logs.rewriting import write_take
    from replay_logs.take import read_take

    kinds = {".csv": (".mcap",), ".mcap": (".csv", ".npz", ".mcap")}
    if take.suffix.lower() not in kinds:
        raise choice_error("kind of take", take.suffix, kinds)
    ending = _check_place(out, kinds[take.suffix.lower()])
    if take.suffix.lower() == ".csv":
        csv_to_take(take, out)
    else:
        held = _told(read_take(take))
        {".csv": take_to_csv, ".npz": take_to_npz, ".mcap": write_take}[ending](held, out)
    print(f"wrote {out}")


def _check_place(out: Path, endings: tuple[str, ...]) -> str:
    """The ending of a file to be written, where it can be; before anything slow."""
    if out.suffix.lower() not in endings:
        raise choice_error(f"ending of {out}", out.suffix, endings)
    check_file_place(out)
    return out.suffix.lower()


def _told(take: "Take") -> "Take":
    """The take, after saying what of it is missing."""
    from capture.progress import tell_all

    tell_all([take.missing] if take.missing else [])
    return take


def _with_bar(what: str, work: Callable[[Progress], object]) -> None:
    from capture.progress import progress_bar

    with progress_bar(what) as progress:
        work(progress)


def _coverage(take: Path, database: str) -> "NDArray":
    """(T,) of the solved take."""
    from capture.library import open_named_database
    from capture.progress import progress_bar
    from capture.solving import solve_take

    with progress_bar("opening the database") as progress:
        known = open_named_database(database, progress)
    with progress_bar("solving") as progress:
        return solve_take(take, known, progress=progress).reconstruction.coverage


def _print(summary: "TakeSummary", figures: dict) -> None:
    from rich.console import Console
    from rich.table import Table

    from capture.take_picture import timeline_text

    made = f", recorded {summary.created[:16].replace('T', ' ')} UTC" if summary.created else ""
    trimmed = ", trimmed" if summary.trimmed else ""
    print(f"{summary.name}: {summary.duration_s:.2f} s{trimmed}{made} with {summary.software or 'another program'}")
    if summary.missing:
        print(summary.missing)
    console = Console()
    health = Table("device", "protocol", "tracker", "role", "Hz", "lost", "jitter ms", box=None, pad_edge=False)
    for device in summary.devices:
        for own in device.health:
            role = device.trackers.get(own.tracker, "-")
            row = (f"{own.rate_hz:.1f}", f"{own.lost:.1%}", f"{own.jitter_ms:.1f}")
            health.add_row(device.name, device.protocol, own.tracker, role, *row)
    console.print(health)
    seen = Table("role", "seen", "dropouts", "longest s", "over time", box=None, pad_edge=False)
    for role in summary.roles:
        line = timeline_text(role.timeline(summary.duration_s, _COLUMNS))
        row = (f"{role.seen:.1%}", str(len(role.dropouts)), f"{role.longest_s:.2f}", line)
        seen.add_row(role.role, *(row if role.readings else ("never", "", "", "")))
    console.print(seen)
    for time_s, text in summary.marks:
        print(f"mark {time_s:8.2f} s  {text}")
    for time_s, values in summary.changes:
        print(f"changed {time_s:5.2f} s  {', '.join(f'{name} = {value}' for name, value in values.items())}")
    for section, values in figures["session"].items():
        print(f"[{section}] {', '.join(f'{name} = {value}' for name, value in values.items())}")
    if "coverage" in figures:
        print(f"coverage {figures['coverage']:.2f}")
