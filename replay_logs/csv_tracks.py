"""Tracks as a table: header `time_s,tracker,x_m,y_m,z_m`, optional `qx,qy,qz,qw` and `quality`, one sample a row.

Rows stand in time order; trackers are named by role; a missing sample is a missing row.
"""

import csv
import math
from collections.abc import Iterable, Mapping
from pathlib import Path

from devices.errors import FileError
from devices.sample import ROLES, TrackerSample
from replay_logs.atomic_file import written_beside

REQUIRED = ("time_s", "tracker", "x_m", "y_m", "z_m")
QUATERNION = ("qx", "qy", "qz", "qw")
QUALITY = "quality"


def read_tracks_csv(path: Path | str) -> list[TrackerSample]:
    """The samples of a tracks file in time order; `host_time_ns` is `time_s` in nanoseconds.

    Raises FileError with the line for a missing column, a value that is no finite number, time going backwards, an
    unknown role, two samples of a tracker at one time, and for a file with no samples.
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return _samples(path, csv.reader(file))
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise FileError(f"{path}: not a text file; tracks are CSV with the header {','.join(REQUIRED)}") from None
    except csv.Error as error:
        raise FileError(f"{path}: not readable as CSV: {error}") from None


def _samples(path: Path, rows: "csv._reader") -> list[TrackerSample]:  # type: ignore[name-defined]
    column = _columns(path, [name.strip() for name in next(rows, [])])
    samples: list[TrackerSample] = []
    newest: dict[str, int] = {}
    for row in rows:
        if not any(cell.strip() for cell in row):
            continue
        where = f"{path}:{rows.line_num}"
        if len(row) <= max(column.values()):
            raise FileError(f"{where}: the row has {len(row)} cells, the header names {max(column.values()) + 1}")
        sample = _sample(where, {name: row[i].strip() for name, i in column.items()})
        if samples and sample.host_time_ns < samples[-1].host_time_ns:
            raise FileError(f"{where}: time goes backwards: rows must stand in time order")
        if newest.get(sample.tracker) == sample.host_time_ns:
            raise FileError(f"{where}: a second sample of {sample.tracker} at the same time")
        newest[sample.tracker] = sample.host_time_ns
        samples.append(sample)
    if not samples:
        raise FileError(f"{path}: no samples in it; a tracks file has one sample a row")
    return samples


def _columns(path: Path, header: list[str]) -> dict[str, int]:
    """Column -> place. Raises FileError where one is missing or named twice."""
    if not header:
        raise FileError(f"{path}: the file is empty; tracks are CSV with the header {','.join(REQUIRED)}")
    wanted = REQUIRED + (QUATERNION if any(name in header for name in QUATERNION) else ())
    for name in wanted:
        if name not in header:
            raise FileError(f"{path}:1: column {name} is missing; the header must name {','.join(wanted)}")
    known = (*wanted, *((QUALITY,) if QUALITY in header else ()))
    for name in known:
        if header.count(name) > 1:
            raise FileError(f"{path}:1: column {name} is named twice")
    return {name: header.index(name) for name in known}


def _sample(where: str, cell: Mapping[str, str]) -> TrackerSample:
    if cell["tracker"] not in ROLES:
        raise FileError(f"{where}: unknown tracker role {cell['tracker']!r}: use {', '.join(ROLES)}")
    time_s, x, y, z = (_number(where, name, cell[name]) for name in ("time_s", "x_m", "y_m", "z_m"))
    orientation = None
    if any(cell.get(name) for name in QUATERNION):
        qx, qy, qz, qw = (_number(where, name, cell[name]) for name in QUATERNION)
        length = math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
        if not 0.9 < length < 1.1:
            raise FileError(f"{where}: {','.join(QUATERNION)} is not a unit quaternion: its length is {length:.3g}")
        orientation = (qx / length, qy / length, qz / length, qw / length)
    quality = _number(where, QUALITY, cell[QUALITY]) if cell.get(QUALITY) else None
    return TrackerSample(cell["tracker"], round(time_s * 1e9), (x, y, z), orientation, quality=quality)


def _number(where: str, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileError(f"{where}: {name} is {text!r}: it must be a finite number; leave out the row of a lost sample")
    return value


def write_tracks_csv(path: Path | str, samples: Iterable[TrackerSample], start_ns: int = 0) -> None:
    """Writes the samples that have a position, in time order; `time_s` counts from `start_ns`.

    Columns for orientation and quality are written where any sample has them. Trackers must be named by role.
    """
    placed = sorted((s for s in samples if s.position is not None), key=lambda s: s.host_time_ns)
    turned = any(s.orientation is not None for s in placed)
    rated = any(s.quality is not None for s in placed)
    with written_beside(Path(path)) as part, part.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow([*REQUIRED, *(QUATERNION if turned else ()), *((QUALITY,) if rated else ())])
        for sample in placed:
            row = [f"{(sample.host_time_ns - start_ns) * 1e-9:.6f}", sample.tracker]
            row += [f"{v:.6f}" for v in sample.position or ()]
            if turned:
                row += [f"{v:.6f}" for v in sample.orientation] if sample.orientation else [""] * 4
            if rated:
                row.append("" if sample.quality is None else f"{sample.quality:.3f}")
            table.writerow(row)
