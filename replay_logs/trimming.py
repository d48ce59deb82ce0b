"""A part of a take that gives the same readings to the last bit.

What a decoder, a clock map, a gate and a filter make of a byte depends on what came before. So a trimmed take keeps
bytes from before its first second and after its last; as many as it takes, found by trying. `span` says what counts.
"""

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass, replace

from devices.errors import SettingError
from devices.intake import DeviceIntake, RoleReading
from devices.intake_settings import write_setting
from devices.sample import ROLES
from replay_logs.frames import LOOK_AHEAD_S
from replay_logs.span import Span
from replay_logs.take import RecordedDevice, Take

_LEAD_INS_S = (0.0, 0.25, 1.0, 4.0, 16.0, 64.0)
"""Seconds of bytes before what must be the same that are tried, then all there are."""
_READINGS_BEFORE = 40
"""Of each role, as many readings before the first frame as its sample period is taken from, and some."""
_AFTER_NS = round((LOOK_AHEAD_S + 0.25) * 1e9)
"""Frames look that far ahead of the last one, and to the reading after."""
_LATE_S = (0.5, 4.0)
"""Seconds of bytes after that are kept: a device's clock may place a reading before its arrival."""


@dataclass(frozen=True)
class Trimmed:
    """take: the part; span: what of it counts; lead_in_s: seconds of bytes that it keeps from before."""

    take: Take
    span: Span
    lead_in_s: float


def trimmed(take: Take, from_s: float | None = None, to_s: float | None = None) -> Trimmed:
    """The take from one second to another, counted from its first reading; its beginning or end where None.

    Frames of the part are bit for bit those of the whole. Raises SettingError where nothing lies between them.
    """
    readings = take.readings()
    if not readings:
        raise SettingError(f"{take.path}: no reading of a tracker with a role in it: nothing to trim")
    span = _span(take, readings, from_s, to_s)
    needed, enough = _needed(readings, span), span.to_ns + _AFTER_NS
    wanted = [reading for reading in readings if needed <= reading.host_time_ns <= enough]
    times = [chunk.host_time_ns for chunks in take.chunks.values() for chunk in chunks]
    tries = [(needed - round(lead_s * 1e9), enough + round(_LATE_S[0] * 1e9)) for lead_s in _LEAD_INS_S]
    tries += [(min(times), enough + round(late_s * 1e9)) for late_s in _LATE_S]
    for begin_ns, end_ns in (*tries, (min(times), max(times))):
        part = _cut(take, begin_ns, end_ns, span)
        if [r for r in part.readings() if needed <= r.host_time_ns <= enough] == wanted:
            kept_ns = min(chunks[0].host_time_ns for chunks in part.chunks.values() if chunks)
            return Trimmed(part, span, max(0.0, (span.from_ns - kept_ns) * 1e-9))
    raise AssertionError("a take with all its bytes gives other readings")


def _span(take: Take, readings: list[RoleReading], from_s: float | None, to_s: float | None) -> Span:
    now = Span.of(take) or Span(*(readings[i].host_time_ns for i in (0, 0, -1)))
    from_ns = now.from_ns if from_s is None else now.from_ns + round(from_s * 1e9)
    to_ns = now.to_ns if to_s is None else now.from_ns + round(to_s * 1e9)
    lasts_s = (now.to_ns - now.from_ns) * 1e-9
    if not now.from_ns <= from_ns < min(to_ns, now.to_ns):
        raise SettingError(f"{take.path}: it lasts from 0 to {lasts_s:.2f} s: give --from and --to in between")
    return Span(now.origin_ns, from_ns, min(to_ns, now.to_ns))


def _needed(readings: list[RoleReading], span: Span) -> int:
    """The host time from which on readings must be the same."""
    earliest = span.from_ns
    for role in range(len(ROLES)):
        times = [r.host_time_ns for r in readings if r.role == role]
        before = bisect_left(times, span.from_ns)
        if before:
            earliest = min(earliest, times[max(0, before - _READINGS_BEFORE)])
    return earliest


def _cut(take: Take, from_ns: int, to_ns: int, span: Span) -> Take:
    """The chunks that came between two moments, with each device's settings as they were by then."""
    first = {name: _before(take, name, from_ns) for name in take.chunks}
    chunks = {
        name: tuple(chunk for chunk in held[first[name] :] if chunk.host_time_ns <= to_ns)
        for name, held in take.chunks.items()
    }
    changes = tuple(
        replace(change, chunks_before={n: max(0, count - first[n]) for n, count in change.chunks_before.items()})
        for change in take.changes
        if change.time_ns <= to_ns and any(count > first[name] for name, count in change.chunks_before.items())
    )
    devices = tuple(_as_it_was(take, device, first[device.name]) for device in take.devices)
    marks = tuple(mark for mark in take.marks if mark.time_ns in span)
    metadata: Mapping[str, str] = {**take.metadata, **span.to_metadata()}
    return replace(take, devices=devices, chunks=chunks, changes=changes, marks=marks, metadata=metadata)


def _before(take: Take, name: str, time_ns: int) -> int:
    """How many of a device's chunks came before a moment."""
    return bisect_left(take.chunks[name], time_ns, key=lambda chunk: chunk.host_time_ns)


def _as_it_was(take: Take, device: RecordedDevice, chunk: int) -> RecordedDevice:
    """The device with its gate and smoothing as they had been changed before that chunk."""
    intake: DeviceIntake = device.intake()
    for change in take.changes:
        if change.chunks_before.get(device.name, 0) <= chunk:
            for name, value in change.values.items():
                if name.startswith(f"device.{device.name}."):
                    write_setting(intake, name.rpartition(".")[2], value)
    return replace(device, gate=intake.gate, smoothing=intake.smoothing)
