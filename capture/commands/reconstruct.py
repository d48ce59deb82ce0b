"""`sixpoint reconstruct`: a whole take into poses, as fast as it goes, and what a changed setting does to them."""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import AsJson, Height, JointNames, ProfileFile
from devices.errors import SettingError
from replay_logs.atomic_file import check_file_place, check_folder_place


def reconstruct(
    takes: Annotated[list[Path], typer.Argument(help="A take (.mcap), or tracks (.csv); with --compare several.")],
    out: Annotated[
        Path, typer.Option(help="The motion to write: .bvh, .glb, .vrma, .csv or .npz; with --compare also a folder.")
    ],
    database: Annotated[
        str | None, typer.Option(help="A folder made by `database build`, or `library` for our own.")
    ] = None,
    method: Annotated[
        str | None, typer.Option(help="`default`, or `paper`: the reconstruction paper to the letter.")
    ] = None,
    height_m: Height = None,
    profile: ProfileFile = None,
    trackers: Annotated[str | None, typer.Option(help="Use only these roles, with commas between.")] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--with", help="A setting to change, such as solver.method=paper.")
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Solve without and with the changes, and report what they do.")
    ] = False,
    joint_names: JointNames = "ours",
    as_json: AsJson = False,
) -> None:
    """Solve a take: one pose a database frame period, from its first sample to its last.

    What an option does not say is as the session said it that recorded the take; what that did not say, either, is our
    own library, the database's body and the default method.
    """
    given = {"database__path": database, "solver__method": method, "performer__height_m": height_m}
    given |= {"performer__profile": None if profile is None else str(profile), "trackers": trackers}
    check_changes(changes or [])
    if compare:
        _compare(takes, out, given, changes or [], joint_names, as_json)
        return
    if len(takes) > 1:
        raise SettingError(f"{len(takes)} takes: give one, or use `sixpoint batch`; --compare takes several")
    _reconstruct(takes[0], out, given, changes or [], joint_names, as_json)


def _reconstruct(
    take: Path, out: Path, given: dict[str, object], changes: Sequence[str], joint_names: str, as_json: bool
) -> None:
    from capture.export import write_motion
    from capture.library import open_named_database
    from capture.progress import progress_bar
    from capture.solve_settings import apply_settings, settings_for
    from capture.solving import solve_with

    preset = _check_motion(out, joint_names)
    settings = apply_settings(settings_for(take, given), changes)
    with progress_bar("opening the database") as progress:
        known = open_named_database(settings.database, progress)
    begin = time.perf_counter()
    with progress_bar("solving") as progress:
        solved = solve_with(take, known, settings, progress)
    seconds = time.perf_counter() - begin
    write_motion(solved.motion, out, joint_names=preset)
    figures = solved.figures() | {"seconds": round(seconds, 3), "out": str(out)}
    print(json.dumps(figures) if as_json else _in_words(figures))


def _compare(
    takes: Sequence[Path], out: Path, given: dict[str, object], changes: Sequence[str], joint_names: str, as_json: bool
) -> None:
    from functools import cache

    from capture.comparing import compare
    from capture.comparison_report import as_dict, markdown, write_report
    from capture.export import write_motion
    from capture.library import open_named_database
    from capture.progress import progress_bar
    from capture.solve_settings import apply_settings, settings_for

    if not changes:
        raise SettingError("--compare needs --with: say which setting changes, such as --with solver.method=paper")
    is_motion = bool(out.suffix)
    preset = _check_motion(out, joint_names) if is_motion else None
    if is_motion and len(takes) > 1:
        raise SettingError(f"--out {out}: the comparison of {len(takes)} takes goes into a folder, without an ending")

    if not is_motion:
        check_folder_place(out)

    @cache
    def opened(name: str):
        with progress_bar("opening the database") as progress:
            return open_named_database(name, progress)

    comparisons = []
    for take in takes:
        before = settings_for(take, given)
        after = apply_settings(before, changes)
        databases = opened(before.database), opened(after.database)
        with progress_bar(f"solving {take.name} twice") as progress:
            comparisons.append(compare(take, before, after, databases, progress))
    if is_motion:
        write_motion(comparisons[0].after.motion, out, joint_names=preset)
    else:
        out.mkdir(parents=True, exist_ok=True)
    written = write_report(comparisons, changes, out.with_suffix(".comparison") if is_motion else out / "comparison")
    if as_json:
        print(json.dumps(as_dict(comparisons, changes) | {"out": [str(path) for path in written]}))
    else:
        print(f"{markdown(comparisons, changes)}\nwrote {', '.join(map(str, written))}")


def check_changes(changes: Sequence[str]) -> None:
    """Before anything slow: whether these can be set, and would change a pose. Raises SettingError."""
    from capture.solve_settings import SolveSettings, apply_settings

    apply_settings(SolveSettings(), changes)
    for change in changes:
        if change.strip().startswith("character."):
            raise SettingError(f"--with {change}: changes no pose, only how a character looks; see `sixpoint replay`")


def _check_motion(out: Path, joint_names: str) -> str | None:
    """Whether such a motion can be written there; the preset of its joints' names, None for our own."""
    from capture.export import motion_writer
    from capture.joint_presets import check_preset

    motion_writer(out)
    check_file_place(out)
    return check_preset(joint_names)


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
