"""Polhemus LIBERTY, LATUS and PATRIOT on their RS-232 port, binary records.

Sources: the VRPN and ROS drivers for LIBERTY and PATRIOT. Over USB these devices are vendor bulk endpoints, which
neither a serial port nor HID reaches.

A record is an 8-byte header (tag, station, command that caused it, error letter, reserved, length of the body), then
the items of the output list. It has no checksum: tag, command, length and numbers that can be a pose keep it in step.
"""

import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from devices.errors import DeviceError
from devices.protocols._conversation import COMMON_BAUDS, CommandLine, Question, find_baud
from devices.protocols._framing import DROP_ONE, WAIT, FramedProtocol, Scan, drop_until
from devices.protocols._poses import INCH_M, POOR_QUALITY
from devices.protocols._records import Field, Item, RecordLayout
from devices.protocols.counters import SequenceGaps, Unwrapped
from devices.protocols.protocol import Drain, Receive, Script, SimulatedDevice, Write
from devices.sample import SampleFlag, TrackerSample

ITEMS: Mapping[int, Item] = {
    0: Item("literal", literal=b" "),
    1: Item("literal", literal=b"\r\n"),
    2: Item("position", "3f"),
    3: Item("position", "3f"),
    4: Item("euler", "3f"),
    5: Item("euler", "3f"),
    7: Item("quaternion", "4f"),
    8: Item("time_ms", "I"),
    9: Item("frame", "I"),
    10: Item("button", "i"),
    11: Item("distortion", "i"),
}
"""The numbers are not FASTRAK's. 3 and 5 are the extended forms, the same floats in binary."""

_HEADER = "2sBBBBH"
_HEADER_SIZE = 8
_NO_ERROR = b" \0"
_DATA_COMMANDS = b"CP"
_ASK_STATIONS = b"\x15"


@dataclass
class Liberty(FramedProtocol):
    """A LIBERTY with 8 or 16 sensors. inches: unit on the wire. items: the output list, in LIBERTY's numbers.

    hemisphere: direction (x, y, z) of the half of space that the sensors stay in, in the source's axes; empty leaves
    what the device has.
    """

    name: ClassVar[str] = "liberty"
    title: ClassVar[str] = "Polhemus LIBERTY (RS-232)"
    rate_hz: ClassVar[float] = 240.0
    max_trackers: ClassVar[int] = 16
    filters_itself: ClassVar[bool] = True

    tags: ClassVar[tuple[bytes, ...]] = (b"LY", b"LU")

    inches: bool = False
    items: tuple[int, ...] = (8, 9, 11, 3, 7)
    hemisphere: tuple[float, ...] = ()
    _clock: Unwrapped = field(default_factory=lambda: Unwrapped(1 << 32), init=False, repr=False, compare=False)
    _gaps: dict[int, SequenceGaps] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self.items, self.hemisphere = tuple(self.items), tuple(self.hemisphere)
        self._layout = RecordLayout(self.items, ITEMS, _HEADER)
        self._body_size = self._layout.size - _HEADER_SIZE

    @property
    def unit_m(self) -> float:
        """Metres in one unit of the wire."""
        return INCH_M if self.inches else 0.01

    def reset(self) -> None:
        super().reset()
        self._clock = Unwrapped(1 << 32)
        self._gaps = {}

    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        initial = self.tags[0][:1]
        if not buffer.startswith(self.tags, start):
            half = len(buffer) - start == 1 and buffer.endswith(initial)
            return WAIT if half else drop_until(buffer, start, initial)
        if len(buffer) - start < self._layout.size:
            return WAIT
        _, station, command, error, _, length = self._layout.header.unpack_from(buffer, start)
        if length != self._body_size or command not in _DATA_COMMANDS or not 1 <= station <= self.max_trackers:
            return DROP_ONE
        values = self._layout.values(buffer, start)
        pose = values and self._layout.pose(values, self.unit_m)
        if not values or not pose:
            self.counters.bad_frames += 1
            return DROP_ONE
        time_ms, frame = self._layout.value(values, "time_ms"), self._layout.value(values, "frame")
        if frame is not None:
            self.counters.missed += self._gaps.setdefault(station, SequenceGaps(1 << 32))(frame)
        sample = TrackerSample(
            tracker=str(station),
            host_time_ns=host_time_ns,
            position=pose[0],
            orientation=pose[1],
            device_time_s=None if time_ms is None else self._clock(time_ms) / 1000,
            sequence=frame,
            quality=POOR_QUALITY if error == ord("u") else None,
            flags=(SampleFlag.NONE if error in _NO_ERROR else SampleFlag.SUSPECT)
            | (SampleFlag.BUTTON if self._layout.value(values, "button") else SampleFlag.NONE),
        )
        return self._layout.size, [sample]

    def start(self) -> Script:
        hint = "check its power and cable, and that it is the RS-232 port (its USB port is no serial port)"
        yield from find_baud(self, COMMON_BAUDS, self._active_sensors, hint)
        yield Write(b"U0\r" if self.inches else b"U1\r")
        yield Write(f"O*,{','.join(map(str, self.items))}\r".encode())
        if self.hemisphere:
            yield Write(f"H*,{','.join(f'{x:g}' for x in self.hemisphere)}\r".encode())
        yield Drain(timeout_s=0.2)
        yield Write(b"C\r")

    def stop(self) -> Script:
        yield Write(b"\rP\r")
        yield Drain()

    def _active_sensors(self) -> Question:
        """Ends a half-typed command and a stream (`P` stops it), and asks in binary which sensors there are."""
        yield Write(b"\rP\r")
        yield Drain()
        yield Write(b"F1\r")
        yield Drain(timeout_s=0.2)
        yield Write(_ASK_STATIONS + b"0\r")
        reply = yield Receive(0.5, size=_HEADER_SIZE + 4)
        found = re.search(rb"(?s)(?:%s).\x15..\x04\x00(.{4})" % b"|".join(self.tags), reply)
        if not found:
            return False
        detected, active = struct.unpack("<HH", found[1])
        if not detected & active:
            raise DeviceError(f"{self.title} has no active sensor: plug one in, or switch its station on")
        return True

    def simulator(self, roles: Sequence[str]) -> "SimulatedLiberty":
        return SimulatedLiberty(self, len(roles))


@dataclass
class Patriot(Liberty):
    """A PATRIOT: LIBERTY's language with two sensors at 60 Hz."""

    name: ClassVar[str] = "patriot"
    title: ClassVar[str] = "Polhemus PATRIOT (RS-232)"
    rate_hz: ClassVar[float] = 60.0
    max_trackers: ClassVar[int] = 2
    tags: ClassVar[tuple[bytes, ...]] = (b"PA",)

    items: tuple[int, ...] = (8, 9, 2, 7)


class SimulatedLiberty(SimulatedDevice):
    """A LIBERTY as it is switched on: text, inches, silent. Its text records are not simulated, only binary ones."""

    def __init__(self, protocol: Liberty, trackers: int) -> None:
        self._tag = protocol.tags[0]
        self._trackers = trackers
        self._line = CommandLine()
        self._samples: Sequence[TrackerSample] = ()
        self._frame = 0
        self._set_up()

    def _set_up(self) -> None:
        self.streaming, self.binary, self.inches = False, False, True
        self._layout = RecordLayout((2, 4, 1), ITEMS, _HEADER)

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._samples = samples
        self._frame += 1
        return self._records("C") if self.streaming else []

    def answer(self, data: bytes) -> bytes:
        return b"".join(map(self._answer, self._line.commands(data)))

    def _answer(self, command: str) -> bytes:
        match command[0]:
            case "C":
                self.streaming = True
            case "P":
                self.streaming = False
                return b"".join(self._records("P"))
            case "F":
                self.binary = command == "F1"
            case "U":
                self.inches = command == "U0"
            case "O":
                items = [int(item) for item in command.split(",")[1:]]
                self._layout = RecordLayout(items, ITEMS, _HEADER)
            case "Q":
                self._frame = 0
            case "\x19":
                self._set_up()
            case "\x15":
                sensors = (1 << self._trackers) - 1
                return struct.pack(f"<{_HEADER}HH", self._tag, 0, 0x15, 0, 0, 4, sensors, sensors)
        return b""

    def _records(self, command: str) -> list[bytes]:
        """One record for each sensor that is seen; one unplugged sends nothing."""
        if not self.binary:
            return []
        unit = INCH_M if self.inches else 0.01
        length = self._layout.size - _HEADER_SIZE
        records = []
        for station, sample in enumerate(self._samples, start=1):
            if sample.position is not None:
                header = (self._tag, station, ord(command), ord(" "), 0, length)
                time_ms = round(1000 * (sample.device_time_s or 0.0)) % (1 << 32)
                numbers: dict[Field, int] = {"time_ms": time_ms, "frame": self._frame % (1 << 32)}
                records.append(self._layout.encode(header, sample, unit, numbers))
        return records
