"""Polhemus ISOTRAK II and 3SPACE, binary records packed into 7 bits.

Sources: the VRPN drivers for both.

Each seven bytes of a record go out as seven low halves of 7 bits and one byte of their top bits; only the very first
byte on the wire has bit 7 set. There is no checksum: this bit, the header and a quaternion of length 1 keep it in step.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from devices.protocols._conversation import COMMON_BAUDS, CommandLine, Question, find_baud
from devices.protocols._framing import DROP_ONE, WAIT, FramedProtocol, Scan
from devices.protocols._poses import FORWARD_RIGHT_DOWN, IDENTITY, unit_quaternion
from devices.protocols.protocol import Drain, Receive, Script, SimulatedDevice, Write
from devices.sample import SampleFlag, TrackerSample

FULL_SCALE_M = 1.6632
"""Reach of a position word, 65.48 inches."""

_RECORD = struct.Struct("<ccc3h4h")
_WIRE_SIZE = _RECORD.size + 3
_STATIONS = (b"1", b"2")
_BUTTON_DOWN, _BUTTON_UP = b"@", b"*"
_ITEMS = b"O2,11\r"
"""The items themselves: position and quaternion. There is no station in this command."""


def pack7(data: bytes) -> bytes:
    """Bytes as they go over the wire: groups of seven low parts and a byte of top bits, the first with bit 7 set."""
    wire = bytearray()
    for at in range(0, len(data), 7):
        group = data[at : at + 7]
        wire += bytes(byte & 0x7F for byte in group)
        wire.append(sum((byte >> 7) << i for i, byte in enumerate(group)))
    wire[0] |= 0x80
    return bytes(wire)


def unpack7(wire: bytes) -> bytes:
    """What `pack7` was given; bit 7 of every byte is ignored."""
    data = bytearray()
    for at in range(0, len(wire), 8):
        *low, top = wire[at : at + 8]
        data += bytes(byte & 0x7F | (top >> i & 1) << 7 for i, byte in enumerate(low))
    return bytes(data)


@dataclass
class Isotrak2(FramedProtocol):
    """An ISOTRAK II with two stations, or a 3SPACE tracker."""

    name: ClassVar[str] = "isotrak2"
    title: ClassVar[str] = "Polhemus ISOTRAK II / 3SPACE"
    rate_hz: ClassVar[float] = 60.0
    max_trackers: ClassVar[int] = 2
    filters_itself: ClassVar[bool] = True

    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        if buffer[start] < 0x80:
            return DROP_ONE
        end = start + _WIRE_SIZE
        if len(buffer) < end:
            return WAIT
        if not buffer[start + 1 : end].isascii():
            return DROP_ONE
        first, station, flag, x, y, z, *turn = _RECORD.unpack(unpack7(buffer[start:end]))
        if first != b"0" or station not in _STATIONS:
            return DROP_ONE
        qw, qx, qy, qz = (value / 32767 for value in turn)
        orientation = unit_quaternion((qx, qy, qz, qw))
        if orientation is None:
            self.counters.bad_frames += 1
            return DROP_ONE
        unit = FULL_SCALE_M / 32767
        flags = SampleFlag.BUTTON if flag == _BUTTON_DOWN else SampleFlag.NONE
        if flag not in (_BUTTON_DOWN, _BUTTON_UP, b" "):
            flags |= SampleFlag.SUSPECT
        axes = FORWARD_RIGHT_DOWN
        position = axes.to_rub((x * unit, y * unit, z * unit))
        sample = TrackerSample(
            station.decode(), host_time_ns, position, axes.quaternion_to_rub(orientation), flags=flags
        )
        return _WIRE_SIZE, [sample]

    def start(self) -> Script:
        hint = "check its power, the null-modem cable, and the baud switches (8 data bits, no parity)"
        yield from find_baud(self, COMMON_BAUDS, self._status, hint)
        yield Write(_ITEMS)
        for station in _STATIONS:
            yield Write(b"R%b\rb%b\r" % (station, station))
        yield Write(b"u")
        yield Drain(timeout_s=0.2)
        yield Write(b"fC")

    def stop(self) -> Script:
        yield Write(b"c")
        yield Drain()

    def _status(self) -> Question:
        """Ends a half-typed command and a stream left on by a crash, then asks for the status record."""
        yield Write(b"\rc")
        yield Drain()
        yield Write(b"S")
        return (yield Receive(0.5, until=b"\r\n")).startswith(b"2")

    def simulator(self, roles: Sequence[str]) -> "SimulatedIsotrak2":
        return SimulatedIsotrak2(len(roles))


class SimulatedIsotrak2(SimulatedDevice):
    """An ISOTRAK II as it is switched on, silent. Only its binary records are simulated."""

    def __init__(self, trackers: int) -> None:
        self._stations = _STATIONS[:trackers]
        self._line = CommandLine("PCcFfUuS\x19")
        self._samples: Sequence[TrackerSample] = ()
        self._binary = False
        self.streaming = False

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._samples = samples
        return self._records() if self.streaming else []

    def answer(self, data: bytes) -> bytes:
        return b"".join(map(self._answer, self._line.commands(data)))

    def _answer(self, command: str) -> bytes:
        match command:
            case "C" | "c":
                self.streaming = command == "C"
            case "F" | "f":
                self._binary = command == "f"
            case "P":
                return b"".join(self._records())
            case "S":
                return b"21S000   ISOTRAKII \r\n"
            case "\x19":
                self.streaming = self._binary = False
        return b""

    def _records(self) -> list[bytes]:
        """One record for each receiver that is seen; one unplugged or out of reach sends nothing."""
        if not self._binary:
            return []
        pairs = zip(self._stations, self._samples, strict=False)
        return [_encoded(station, sample) for station, sample in pairs if _within_reach(sample)]


def _within_reach(sample: TrackerSample) -> bool:
    return sample.position is not None and max(map(abs, sample.position)) <= FULL_SCALE_M


def _encoded(station: bytes, sample: TrackerSample) -> bytes:
    axes = FORWARD_RIGHT_DOWN
    place = axes.from_rub(sample.position or (0.0, 0.0, 0.0))
    x, y, z, w = axes.quaternion_from_rub(sample.orientation or IDENTITY)
    numbers = [round(value / FULL_SCALE_M * 32767) for value in place] + [round(q * 32767) for q in (w, x, y, z)]
    flag = _BUTTON_DOWN if sample.flags & SampleFlag.BUTTON else _BUTTON_UP
    return pack7(_RECORD.pack(b"0", station, flag, *(max(-32768, min(32767, n)) for n in numbers)))
