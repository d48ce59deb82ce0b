"""The generic text format: one `$TRK...` sentence a line, in the manner of NMEA 0183, for trackers people build.

`$` body `*` HH CR LF, HH the XOR of the body's bytes. Sentences (docs/devices.md has the whole table): TRKI identity,
TRKN a tracker's role, TRKP a sample, TRKQ query, TRKS start and stop. Lines of anything else are ignored.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import xor
from typing import ClassVar

from devices.axes import Axes
from devices.errors import SettingError
from devices.protocols.counters import SequenceGaps, Unwrapped
from devices.protocols.protocol import (
    DeviceProtocol,
    Drain,
    Receive,
    Script,
    SerialFormat,
    SimulatedDevice,
    Write,
)
from devices.sample import ROLES, SampleFlag, TrackerSample

MAX_SENTENCE = 120
"""Longest sentence in bytes, from `$` to the last checksum digit."""
FARTHEST_M = 50.0
"""No tracker is farther off on any axis; a number beyond is a fault of the line."""
_PART_SENTENCE = MAX_SENTENCE + 1
_FIELDS = 14
_START = b"$TRK"


def sentence(body: str) -> bytes:
    """The whole line for a body such as `TRKQ`: `$TRKQ*1C` CR LF."""
    return f"${body}*{reduce(xor, body.encode()):02X}\r\n".encode()


@dataclass
class GenericText(DeviceProtocol):
    """axes: the device's frame, see `devices.axes`; its own `TRKI` sentence overrides it."""

    name: ClassVar[str] = "generic"
    title: ClassVar[str] = "Generic text lines ($TRKP)"
    serial: ClassVar[SerialFormat] = SerialFormat(baud=460800)
    max_trackers: ClassVar[int] = 16

    axes: str = "RUB"
    require_checksum: bool = True
    _part: bytes = field(default=b"", init=False, repr=False)
    _clock: Unwrapped = field(default_factory=lambda: Unwrapped(1 << 32), init=False, repr=False)
    _gaps: dict[str, SequenceGaps] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        self._frame = Axes(self.axes)

    def reset(self) -> None:
        super().reset()
        self._part, self._clock, self._gaps = b"", Unwrapped(1 << 32), {}

    def feed(self, data: bytes, host_time_ns: int) -> list[TrackerSample]:
        *lines, rest = (self._part + data).split(b"\n")
        self._part = rest[-_PART_SENTENCE:]
        self.counters.bytes_dropped += len(rest) - len(self._part)
        samples = []
        for line in lines:
            sample = self._line(line, host_time_ns)
            if sample is not None:
                samples.append(sample)
        return samples

    def _line(self, line: bytes, host_time_ns: int) -> TrackerSample | None:
        start = line.rfind(_START)
        if start < 0:
            self.counters.bytes_dropped += len(line) + 1
            return None
        self.counters.bytes_dropped += start
        fields = self._checked_fields(line[start:].removesuffix(b"\r"))
        try:
            if fields[0] == "TRKP":
                return self._sample(fields, host_time_ns)
            if fields[0] == "TRKI":
                self._frame, self.axes = Axes(fields[6]), fields[6]
            elif fields[0] == "TRKN" and fields[2] in ROLES:
                self.role_hints[fields[1]] = fields[2]
            elif not fields[0]:
                self.counters.bad_frames += 1
        except (ValueError, IndexError, SettingError):
            self.counters.bad_frames += 1
        return None

    def _checked_fields(self, found: bytes) -> list[str]:
        """The fields of a sentence, [""] where it is too long or its checksum does not hold."""
        body, star, checksum = found[1:].rpartition(b"*")
        if not star and not self.require_checksum:
            body, checksum = found[1:], b"%02X" % reduce(xor, found[1:])
        if len(found) > MAX_SENTENCE or b"%02X" % reduce(xor, body, 0) != checksum:
            return [""]
        return body.decode("ascii", "replace").split(",")

    def _sample(self, fields: list[str], host_time_ns: int) -> TrackerSample:
        if len(fields) != _FIELDS:
            raise ValueError("a TRKP sentence has 14 fields")
        _, tracker, sequence, t_us, x, y, z, qw, qx, qy, qz, quality, battery, flags = fields
        position = orientation = None
        if x and y and z:
            position = (float(x), float(y), float(z))
            # Written so that NaN fails too.
            if not all(abs(v) < FARTHEST_M for v in position):
                raise ValueError("a position beyond any room")
            position = self._frame.to_rub(position)
        if qw and qx and qy and qz:
            orientation = self._frame.quaternion_to_rub(unit((float(qx), float(qy), float(qz), float(qw))))
        number = int(sequence) if sequence else None
        device_time_s = self._clock(int(t_us)) * 1e-6 if t_us else None
        if number is not None:
            self.counters.missed += self._gaps.setdefault(tracker, SequenceGaps(1 << 16))(number)
        return TrackerSample(
            tracker, host_time_ns, position, orientation, device_time_s, number,
            percent(quality), percent(battery), SampleFlag(int(flags, 16) & 15) if flags else SampleFlag.NONE,
        )  # fmt: skip

    def start(self) -> Script:
        """Ask who is there, take the answer's axes and roles, then start; silent devices stream anyway."""
        yield Drain(0.02, 0.2)
        yield Write(sentence("TRKQ"))
        reply = yield Receive(0.3, until=b"$TRKI,")
        # The names of its trackers follow; those that come later are read from the stream.
        reply += yield Receive(0.1)
        for line in reply.split(b"\n"):
            self._line(line, 0)
        yield Write(sentence(f"TRKS,1,{self.rate_hz:.0f}"))

    def stop(self) -> Script:
        yield Write(sentence("TRKS,0"))

    def simulator(self, roles: Sequence[str]) -> "SimulatedGenericText":
        return SimulatedGenericText(tuple(roles), self.axes, self.rate_hz)


def unit(q: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """A quaternion made exactly unit. Raises ValueError where its length is not within 0.9 to 1.1."""
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if not 0.9 < length < 1.1:
        raise ValueError("not a unit quaternion")
    return (q[0] / length, q[1] / length, q[2] / length, q[3] / length)


def percent(text: str) -> float | None:
    """`87` is 0.87, nothing is None. Raises ValueError outside 0 to 100."""
    if not text:
        return None
    value = int(text)
    if not 0 <= value <= 100:
        raise ValueError("not a percentage")
    return value / 100


def as_percent(value: float | None) -> str:
    """The field for a share of 0 to 1, empty for None."""
    return "" if value is None else f"{round(100 * value)}"


@dataclass
class SimulatedGenericText(SimulatedDevice):
    """Streams from the start, as a device may; obeys TRKS and answers TRKQ."""

    roles: tuple[str, ...]
    axes: str
    rate_hz: float
    streaming: bool = True
    _part: bytes = b""
    _sequence: int = -1

    def identity(self) -> bytes:
        """What it says of itself: a TRKI and a TRKN for each tracker."""
        names = [
            sentence(f"TRKN,{i},{role},{role.replace('_', ' ').capitalize()}") for i, role in enumerate(self.roles, 1)
        ]
        return sentence(f"TRKI,1,sixpoint,SIM1,{len(self.roles)},{self.rate_hz:.0f},{self.axes},pqb") + b"".join(names)

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._sequence = (self._sequence + 1) % (1 << 16)
        return [self.encode(s, self._sequence) for s in samples] if self.streaming else []

    def encode(self, sample: TrackerSample, sequence: int) -> bytes:
        """The TRKP line of one sample; numbers have four decimals."""
        frame, numbers = Axes(self.axes), [""] * 7
        if sample.position is not None:
            numbers[:3] = [f"{v:.4f}" for v in frame.from_rub(sample.position)]
        if sample.orientation is not None:
            x, y, z, w = frame.quaternion_from_rub(sample.orientation)
            numbers[3:] = [f"{v:.4f}" for v in (w, x, y, z)]
        t_us = "" if sample.device_time_s is None else f"{round(sample.device_time_s * 1e6) % (1 << 32)}"
        flags = sample.flags | (SampleFlag.HELD if sample.position is None else 0)
        tail = [as_percent(sample.quality), as_percent(sample.battery), f"{flags & 15:X}"]
        return sentence(",".join(["TRKP", sample.tracker, str(sequence), t_us, *numbers, *tail]))

    def answer(self, data: bytes) -> bytes:
        *lines, self._part = (self._part + data).split(b"\n")
        return b"".join(self._obey(line.strip()) for line in lines)

    def _obey(self, line: bytes) -> bytes:
        if line == sentence("TRKQ").strip():
            return self.identity()
        if line.startswith(b"$TRKS,"):
            self.streaming = line.startswith(b"$TRKS,1")
        return b""
