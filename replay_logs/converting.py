"""Takes as tables and arrays, and tracks as takes."""

from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np

from devices.driver import RawChunk, Reading
from devices.errors import FileError
from devices.filters import GateSettings
from devices.intake import IDENTITY_ASSIGNMENT, RoleReading
from devices.protocols import make_protocol
from devices.sample import ROLES, TrackerSample
from replay_logs.atomic_file import written_beside
from replay_logs.csv_tracks import read_tracks_csv, write_tracks_csv
from replay_logs.recorder import TakeRecorder
from replay_logs.span import Span
from replay_logs.take import RecordedDevice, Take

TRACKS = "tracks"
"""What the device of a take is called that was made of a tracks file."""


def role_readings(take: Take) -> list[RoleReading]:
    """All readings that count, in the order of host time: what the solver is given, gate and smoothing done.

    Raises FileError where there are none.
    """
    span = Span.of(take)
    found = [r for r in take.readings() if span is None or r.host_time_ns in span]
    if not found:
        raise FileError(f"{take.path}: no reading of a tracker with a role in it")
    return found


def take_to_csv(take: Take, path: Path | str) -> None:
    """Writes the readings as tracks, `time_s` from the first one, in micrometres and microseconds."""
    readings = role_readings(take)
    samples = [TrackerSample(ROLES[r.role], r.host_time_ns, r.position, r.orientation) for r in readings]
    write_tracks_csv(path, _one_a_time(samples), readings[0].host_time_ns)


def _one_a_time(samples: list[TrackerSample]) -> list[TrackerSample]:
    """Of samples of one tracker in the same microsecond the last: a batch without a clock has one time."""
    start_ns = samples[0].host_time_ns
    return list({((s.host_time_ns - start_ns + 500) // 1000, s.tracker): s for s in samples}.values())


def take_to_npz(take: Take, path: Path | str) -> None:
    """Writes the readings as arrays, one row each, exactly.

    `host_time_ns` (N,) int64; `role` (N,) index into `roles` (6,); `positions_m` (N, 3) world; `rotations_xyzw` (N, 4),
    NaN where there is none; `mark_time_ns` and `mark_text` (M,).
    """
    readings = role_readings(take)
    with written_beside(Path(path)) as part, part.open("wb") as file:
        np.savez_compressed(
            file,
            roles=np.array(ROLES),
            role=np.array([r.role for r in readings], np.int8),
            host_time_ns=np.array([r.host_time_ns for r in readings], np.int64),
            positions_m=np.array([r.position for r in readings]),
            rotations_xyzw=np.array([r.orientation or (np.nan,) * 4 for r in readings]),
            mark_time_ns=np.array([mark.time_ns for mark in take.marks], np.int64),
            mark_text=np.array([mark.text for mark in take.marks], str),
        )


def csv_to_take(source: Path | str, path: Path | str) -> None:
    """Makes a take of a tracks file: lines of the generic text protocol, one sample each, at the file's own times.

    Tracks of six decimals come back to the digit. Quality is kept in whole percent. Raises FileError where the tracks
    cannot be read, a position is farther than the protocol goes, or there is a take already.
    """
    samples = read_tracks_csv(source)
    path = Path(path)
    if path.exists():
        raise FileError(f"{path}: there is a file already; takes are not overwritten")
    protocol = make_protocol("generic")
    device = RecordedDevice(TRACKS, "generic", protocol.options(), IDENTITY_ASSIGNMENT, gate=GateSettings())
    with written_beside(path) as part, TakeRecorder(part, {"made_of": Path(source).name}) as recorder:
        recorder.add_device(device)
        recorder.write(TRACKS, Reading((RawChunk(samples[0].host_time_ns, b""),)))
        for sample in samples:
            line = _line(sample)
            read = protocol.feed(line, sample.host_time_ns)
            if not read:
                raise FileError(f"{source}: {sample.tracker} at {sample.host_time_ns * 1e-9:.3f} s is beyond any room")
            recorder.write(TRACKS, Reading((RawChunk(sample.host_time_ns, line),), tuple(read)))


def _line(sample: TrackerSample) -> bytes:
    """A `TRKP` sentence with as many decimals as a tracks file has, or more where they fit into one."""
    place = [repr(v) if sample.orientation is None else f"{v:.6f}" for v in sample.position or ()]
    turn = [""] * 4
    if sample.orientation is not None:
        x, y, z, w = sample.orientation
        turn = [f"{v:.10f}" for v in (w, x, y, z)]
    quality = "" if sample.quality is None else f"{round(100 * sample.quality)}"
    body = ",".join(["TRKP", sample.tracker, "", "", *place, *turn, quality, "", "0"]).encode()
    return b"$%s*%02X\r\n" % (body, reduce(xor, body))
