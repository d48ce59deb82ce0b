"""Two takes as one: devices beside each other in time, or one take after the other."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Literal

from devices.driver import RawChunk
from devices.errors import SettingError, choice_error
from devices.sample import ROLES
from replay_logs.span import Span
from replay_logs.take import RecordedDevice, SettingsChange, Take

Order = Literal["auto", "parallel", "after"]
ORDERS: tuple[Order, ...] = ("auto", "parallel", "after")
GAP_S = 1.0
"""Seconds between a take and one that is put after it: no frame is made up in between."""
_SAME_CLOCK_S = 2.0
"""Host clocks whose zero falls on the same moment of the day, this near, are one: that of one machine's run."""


@dataclass(frozen=True)
class Merged:
    """take: both in one. told: in words, whose clock counts and how the other was moved to it."""

    take: Take
    told: str


def merged(a: Take, b: Take, order: str = "auto", offset_s: float | None = None) -> Merged:
    """Both takes on the clock of `a`.

    order: `parallel` keeps what was at one moment together; `after` puts `b` a second behind the end of `a`; `auto` is
    parallel where the takes overlap in time. offset_s: the first byte of `b` comes so long after that of `a`, whatever
    the clocks say. A device of `b` whose name is taken is the same device where it comes after and is described alike,
    else it gets a number. Raises SettingError for an unknown order, and for a trimmed take.
    """
    if order not in ORDERS:
        raise choice_error("order", order, ORDERS)
    for take in (a, b):
        if Span.of(take) is not None:
            raise SettingError(f"{take.path}: a trimmed take holds more than it shows; merge the whole ones, then trim")
    shift_ns, told = _shift(a, b, order, offset_s)
    moved = _moved(b, shift_ns)
    begins_after = _bounds(moved)[0] > _bounds(a)[1]
    names = _names(a, moved, may_join=begins_after)
    moved = _renamed(moved, names)
    if not begins_after:
        told += "".join(f"; both have {role}: its readings are mixed" for role in _shared_roles(a, moved))
    new = {name: given for name, given in names.items() if name != given}
    told += "".join(f"; its device {name} is called {given}" for name, given in new.items())
    devices = a.devices + tuple(device for device in moved.devices if device.name not in a.chunks)
    chunks = {
        device.name: a.chunks.get(device.name, ()) + _opened(moved.chunks.get(device.name, ())) for device in devices
    }
    changes = _changes(a, moved)
    marks = tuple(sorted((*a.marks, *moved.marks), key=lambda mark: mark.time_ns))
    metadata = {**a.metadata, "merged": f"{a.path.name} and {b.path.name}: {told}"}
    missing = "; ".join(take.missing for take in (a, b) if take.missing) or None
    return Merged(Take(a.path, devices, chunks, metadata, missing, marks, changes), told)


def _shift(a: Take, b: Take, order: str, offset_s: float | None) -> tuple[int, str]:
    """By how many nanoseconds `b` is moved, and why in words."""
    (a_first, a_last), (b_first, b_last) = _bounds(a), _bounds(b)
    if offset_s is not None:
        return a_first + round(offset_s * 1e9) - b_first, f"{_name(b)} begins {offset_s:g} s after {_name(a)}, as told"
    same, shift_ns, told = _clocks(a, b)
    overlaps = b_first + shift_ns <= a_last and a_first <= b_last + shift_ns
    if order == "parallel" or (order == "auto" and overlaps):
        if not overlaps:
            raise SettingError(
                f"{_name(a)} and {_name(b)} do not overlap in time ({told}): merge them with --order after, or say with"
                " --offset-s how long after the first the second begins"
            )
        return shift_ns, told
    if same and order == "auto" and b_first > a_last + GAP_S * 1e9:
        return 0, told
    return a_last + round(GAP_S * 1e9) - b_first, f"{_name(b)} is put {GAP_S:g} s after the end of {_name(a)}"


def _clocks(a: Take, b: Take) -> tuple[bool, int, str]:
    """Whether both have one host clock, what else is added to that of `b`, and how that is known."""
    zeros = [_zero_s(take) for take in (a, b)]
    if zeros[0] is None or zeros[1] is None:
        return True, 0, "neither says when it was made: taken as one clock's"
    apart_s = zeros[1] - zeros[0]
    if abs(apart_s) < _SAME_CLOCK_S:
        return True, 0, "both have the clock of one machine's run"
    return False, round(apart_s * 1e9), "two clocks, matched by the time of day: to about a second"


def _zero_s(take: Take) -> float | None:
    """The moment of the day, UTC, at which the take's host clock was zero; None where it is not known."""
    try:
        made = datetime.fromisoformat(take.metadata["created"])
    except (KeyError, ValueError):
        return None
    return made.timestamp() - _bounds(take)[0] * 1e-9


def _bounds(take: Take) -> tuple[int, int]:
    """Host time of its first and its last bytes."""
    times = [chunk.host_time_ns for chunks in take.chunks.values() for chunk in (*chunks[:1], *chunks[-1:])]
    return min(times), max(times)


def _name(take: Take) -> str:
    return Path(take.path).name


def _shared_roles(a: Take, b: Take) -> list[str]:
    there, here = ({reading.role for reading in take.readings()} for take in (a, b))
    return [ROLES[role] for role in sorted(there & here)]


def _moved(take: Take, by_ns: int) -> Take:
    if not by_ns:
        return take
    return replace(
        take,
        chunks={
            name: tuple(RawChunk(chunk.host_time_ns + by_ns, chunk.data) for chunk in chunks)
            for name, chunks in take.chunks.items()
        },
        marks=tuple(replace(mark, time_ns=mark.time_ns + by_ns) for mark in take.marks),
        changes=tuple(replace(change, time_ns=change.time_ns + by_ns) for change in take.changes),
    )


def _names(a: Take, b: Take, may_join: bool) -> dict[str, str]:
    """What each device of `b` is called in the whole."""
    taken: dict[str, RecordedDevice] = {device.name: device for device in a.devices}
    changed = {name.rpartition(".")[0].removeprefix("device.") for change in a.changes for name in change.values}
    names = {}
    for device in b.devices:
        name, number = device.name, 2
        joins = may_join and taken.get(name) == device and name not in changed
        while name in taken and not joins:
            name, number = f"{device.name}_{number}", number + 1
        taken[name] = replace(device, name=name)
        names[device.name] = name
    return names


def _renamed(take: Take, names: Mapping[str, str]) -> Take:
    def key(setting: str) -> str:
        section, _, rest = setting.partition(".")
        device, _, name = rest.rpartition(".")
        return f"device.{names[device]}.{name}" if section == "device" and device in names else setting

    return replace(
        take,
        devices=tuple(replace(device, name=names[device.name]) for device in take.devices),
        chunks={names[name]: chunks for name, chunks in take.chunks.items()},
        changes=tuple(
            replace(
                change,
                values={key(name): value for name, value in change.values.items()},
                chunks_before={names[name]: count for name, count in change.chunks_before.items()},
            )
            for change in take.changes
        ),
    )


def _opened(chunks: tuple[RawChunk, ...]) -> tuple[RawChunk, ...]:
    """With the empty chunk at its head that marks where a device was opened."""
    if not chunks or not chunks[0].data:
        return chunks
    return (RawChunk(chunks[0].host_time_ns, b""), *chunks)


def _changes(a: Take, b: Take) -> tuple[SettingsChange, ...]:
    """Those of both in time order, each counting the chunks of both that stand before it."""
    own = [(change, a, b) for change in a.changes] + [(change, b, a) for change in b.changes]
    return tuple(_counted(*entry) for entry in sorted(own, key=lambda entry: entry[0].time_ns))


def _counted(change: SettingsChange, own: Take, other: Take) -> SettingsChange:
    before = {name: sum(c.host_time_ns < change.time_ns for c in chunks) for name, chunks in other.chunks.items()}
    for name, count in change.chunks_before.items():
        before[name] = before.get(name, 0) + count
    return replace(change, chunks_before=before)
