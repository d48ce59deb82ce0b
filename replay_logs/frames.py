"""A whole take or tracks file as frames: one each frame period from its first sample to its last."""

from collections.abc import Callable
from pathlib import Path

from devices.assembler import FrameAssembler
from devices.errors import FileError
from devices.frame import TrackerFrame
from devices.intake import IDENTITY_ASSIGNMENT, DeviceIntake, RoleReading
from replay_logs.csv_tracks import read_tracks_csv
from replay_logs.span import Span
from replay_logs.take import Take, read_take

LOOK_AHEAD_S = 0.5
"""How much of a track is known before its frames are made, so that its sample period is."""


def load_frames(path: Path | str, fps: float, warn: Callable[[str], None] = lambda _: None) -> list[TrackerFrame]:
    """Frames of a take (`.mcap`) or a tracks file (`.csv`), `fps` a second, from the first sample to the last.

    A role without a reading at a moment is missing in that frame; only between neighbouring samples is there
    interpolation. `time_s` is a tracks file's own time, and counts from the first sample in a take. `warn` is given
    what could not be read of a damaged take. The same file gives the same frames. Raises FileError for what cannot be
    read, and for any other kind of file.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind == ".csv":
        readings = DeviceIntake(IDENTITY_ASSIGNMENT).readings(read_tracks_csv(path))
        return assemble(readings, fps, epoch_ns=0)
    if kind == ".mcap":
        take = read_take(path)
        if take.missing:
            warn(take.missing)
        return take_frames(take, fps)
    raise FileError(f"{path}: a take ends in .mcap, a tracks file in .csv")


def take_frames(take: Take, fps: float) -> list[TrackerFrame]:
    """`load_frames` of a take in memory; of a trimmed one those that the whole take had in its span, `time_s` from 0.

    Raises FileError where no reading has a role.
    """
    readings, span = take.readings(), Span.of(take)
    if not readings:
        raise FileError(f"{take.path}: no sample of a tracker with a role in it; its devices have {_assigned(take)}")
    if span is None:
        return assemble(readings, fps)
    first, last = span.frames(fps)
    epoch_ns = span.origin_ns + round(first / fps * 1e9)
    frames = assemble(readings, fps, epoch_ns, start_ns=span.origin_ns, first=first)[: last + 1 - first]
    if not frames:
        raise FileError(f"{take.path}: no moment of a frame between its first and its last second; trim less of it")
    return frames


def assemble(
    readings: list[RoleReading], fps: float, epoch_ns: int | None = None, start_ns: int | None = None, first: int = 0
) -> list[TrackerFrame]:
    """Frames from the first reading (or from frame `first` after `start_ns`) to the last; readings in time order."""
    assembler = FrameAssembler(fps, LOOK_AHEAD_S, extrapolate_s=0.0, start_ns=start_ns, epoch_ns=epoch_ns, first=first)
    frames: list[TrackerFrame] = []
    for reading in readings:
        assembler.push((reading,))
        frames += assembler.frames(reading.host_time_ns)
    return frames + assembler.finish(readings[-1].host_time_ns)


def _assigned(take: Take) -> str:
    trackers = [f"{d.name}: {', '.join(d.assignment) or 'no tracker'}" for d in take.devices]
    return "; ".join(trackers) + " assigned"
