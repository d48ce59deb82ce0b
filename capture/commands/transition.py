"""`sixpoint transition`: from any frame of one clip into another, a playlist of many, or every pair of a folder."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from devices.errors import FileError, SettingError
from replay_logs.atomic_file import check_file_place

if TYPE_CHECKING:
    from capture.transition_evaluation import TransitionReport
    from reconstruction.motion import Motion
    from reconstruction.transition import Cue, Transition, TransitionClip


def transition(
    clips: Annotated[list[Path] | None, typer.Argument(help="Motions (.bvh, .amc): A B, or a whole sequence.")] = None,
    out: Annotated[Path | None, typer.Option(help="The motion to write: .bvh, .glb, .vrma, .csv or .npz.")] = None,
    at: Annotated[
        str | None, typer.Option(metavar="FRAME|SECONDS", help="Where A is left: 90, or 1.5s. Its end where not given.")
    ] = None,
    into: Annotated[int, typer.Option(min=0, help="The frame of B that is entered.")] = 0,
    method: Annotated[
        str, typer.Option(help="natural, or paper: to the letter; rivals: switch, cross-fade, inertialised.")
    ] = "natural",
    playlist: Annotated[
        Path | None, typer.Option(help="A text file, one clip a line: MOTION [LEAVE_AT [ENTER_AT]]; # comments.")
    ] = None,
    matrix: Annotated[
        Path | None, typer.Option(help="A folder: report every pair of its motions; --out then takes .csv.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Join motions by transitions whose time follows from how far and how fast the joints have to go.

    A is left at any frame, in mid-flight too; B is turned and moved to where the transition ends, fitted to A's body
    and frame rate. Planted feet stay planted.
    """
    from capture.export import motion_writer, write_motion

    given = [name for name, value in (("CLIPS", clips), ("--playlist", playlist), ("--matrix", matrix)) if value]
    if len(given) != 1:
        raise SettingError(f"give motions, --playlist or --matrix, one of them (got {' and '.join(given) or 'none'})")
    if matrix:
        _report_matrix(matrix, out, method, as_json)
        return
    if out is None:
        raise SettingError("--out is missing: the motion to write, for example --out C.bvh")
    motion_writer(out)
    check_file_place(out)
    motion, steps = _sequence(_cues_of_playlist(playlist) if playlist else _cues(clips or [], at, into), method)
    write_motion(motion, out)
    rows = [_figures(step) for step in steps]
    if as_json:
        print(json.dumps({"out": str(out), "seconds": round(motion.duration_s, 3), "transitions": rows}))
        return
    for row in rows:
        print(f"transition of {row['time_s']:.2f} s ({row['frames']} frames, {row['method']})")
    print(f"{len(motion)} frames, {motion.duration_s:.2f} s, in {out}")


def evaluate_transitions(
    data: Annotated[list[Path], typer.Option(help="Motion files (.bvh, .amc), or folders searched for them.")],
    pairs: Annotated[int, typer.Option(min=1, help="How many pairs of clips.")] = 200,
    exits: Annotated[int, typer.Option(min=1, help="At how many frames each first clip is left.")] = 4,
    seed: Annotated[int, typer.Option(help="Draws the same pairs and frames again.")] = 7,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Measure transitions on given motions: smoothness, sliding feet, the floor, beside what games do."""
    from capture.progress import progress_bar
    from capture.transition_evaluation import evaluate_transitions as evaluate

    for path in data:
        if not path.exists():
            raise FileError(f"{path}: no such file or folder")
    with progress_bar("transitions") as progress:
        report = evaluate(data, pairs, exits, seed, progress)
    if as_json:
        print(json.dumps(report.as_dict()))
    else:
        _print_report(report)


def _print_report(report: "TransitionReport") -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for head in ("method", "T s", "smooth %", "peak", "jerk", "slide", "floor cm", "most cm", "ms"):
        table.add_column(head, no_wrap=True)
    for row in report.methods:
        table.add_row(
            row.method,
            f"{row.time_s:.2f}",
            f"{100 * row.acceleration_share:.1f}",
            f"{row.acceleration_ratio:.2f}",
            f"{row.jerk_rad_s3:.0f}",
            f"{row.slide_ratio:.2f}",
            f"{row.penetration_mean_cm:.3f}",
            f"{row.penetration_max_cm:.2f}",
            f"{row.generation_60_frames_ms or row.generation_ms:.2f}",
        )
    Console().print(table)
    print("smooth: peak angular acceleration at most 1.2 times the clips' own; peak and slide: against the clips' own")
    print(f"{report.pairs} pairs of {report.clips} clips, {report.exits} exits each, seed {report.seed}")
    print(f"classes agree with the file names in {100 * report.classification_agreement:.1f} % of {report.classified}")
    print(f"one live step takes {report.live_step_ms:.3f} ms (median)")
    for reason in report.skipped:
        print(f"left out: {reason}")


def _cues(clips: list[Path], at: str | None, into: int) -> list["Cue"]:
    """A and B as the options say; of more clips each plays to its end."""
    from reconstruction.transition import Cue

    if len(clips) < 2:
        raise SettingError("two motions are needed at least: A B")
    first, *others = (_clip(path) for path in clips)
    cues = [Cue(first, 0, None if at is None else _frame(at, first))]
    return [*cues, *(Cue(clip, into if k == 0 else 0) for k, clip in enumerate(others))]


def _cues_of_playlist(path: Path) -> list["Cue"]:
    """One cue a line: a motion (relative to the playlist), where it is left, the frame it is entered at."""
    from reconstruction.transition import Cue

    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: {getattr(error, 'strerror', None) or 'not a text file'}") from error
    cues = []
    for number, line in enumerate(lines, 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            clip = _clip(path.parent / words[0])
            leave = None if len(words) < 2 or words[1] == "-" else _frame(words[1], clip)
            cues.append(Cue(clip, int(words[2]) if len(words) > 2 else 0, leave))
        except ValueError:
            raise FileError(f"{path}:{number}: the frame entered must be a whole number, not {words[2]!r}") from None
        except SettingError as error:
            raise FileError(f"{path}:{number}: {error}") from error
    if len(cues) < 2:
        raise FileError(f"{path}: {len(cues)} motions; a playlist needs two at least")
    return cues


def _clip(path: Path) -> "TransitionClip":
    from reconstruction.motion_files import read_motion
    from reconstruction.transition import prepared

    return prepared(read_motion(path))


def _frame(text: str, clip: "TransitionClip") -> int:
    """The frame that `90`, `1.5` or `1.5s` means: whole numbers are frames, others seconds."""
    number = text.removesuffix("s")
    try:
        frame = int(number) if number == text and "." not in text else round(float(number) * clip.fps)
    except (ValueError, OverflowError):
        raise SettingError(f"--at {text!r}: use a frame (90) or seconds (1.5s)") from None
    if not 0 <= frame < len(clip):
        raise SettingError(
            f"--at {text}: {clip.motion.name!r} has frames 0 to {len(clip) - 1}, {clip.motion.duration_s:.2f} s"
        )
    return frame


def _sequence(cues: list["Cue"], method: str) -> tuple["Motion", list["Transition"]]:
    from reconstruction.transition import sequence

    return sequence(cues, method)


def _figures(step: "Transition") -> dict:
    return {"time_s": round(step.duration_s, 4), "frames": len(step.between), "method": step.method}


def _report_matrix(folder: Path, out: Path | None, method: str, as_json: bool) -> None:
    """Every pair of a folder's motions, as a table, JSON or CSV."""
    from dataclasses import asdict

    from capture.progress import progress_bar
    from capture.transition_evaluation import transition_matrix
    from reconstruction.motion_files import MOTION_ENDINGS

    if not folder.is_dir():
        raise FileError(f"{folder}: no such folder")
    if out is not None and out.suffix.lower() != ".csv":
        raise SettingError(f"--out {out}: the matrix is written as .csv")
    files = sorted(file for file in folder.rglob("*") if file.suffix.lower() in MOTION_ENDINGS)
    if len(files) < 2:
        raise FileError(f"{folder}: {len(files)} motions; a matrix needs two at least")
    clips = [_clip(file) for file in files]
    with progress_bar("transitions") as progress:
        rows = [asdict(row) for row in transition_matrix(clips, method, progress=progress)]
    if out is not None:
        _write_csv(rows, out)
    if as_json:
        print(json.dumps(rows))
    else:
        _print_table(rows)


def _write_csv(rows: list[dict], out: Path) -> None:
    import csv

    beside = out.with_name(f".{out.name}.part")
    try:
        with beside.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
        beside.replace(out)
    finally:
        beside.unlink(missing_ok=True)


def _print_table(rows: list[dict]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("from", "class", "into", "class", "T s", "peak/own rad/s2", "slide m/s", "below floor cm")
    for row in rows:
        table.add_row(
            row["left"],
            row["left_class"],
            row["entered"],
            row["entered_class"],
            f"{row['time_s']:.2f}",
            f"{row['peak_acceleration_rad_s2']:.0f}/{row['own_acceleration_rad_s2']:.0f}",
            f"{row['slide_m_s']:.2f}",
            f"{row['penetration_cm']:.1f}",
        )
    Console().print(table)
