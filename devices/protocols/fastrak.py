"""Polhemus FASTRAK on RS-232: text with fixed columns, or little-endian floats.

Sources: FASTRAK manual revision G (2012), command reference and data records; the VRPN and VESS drivers.

A record is '0', the station's digit, an error letter (blank = good) and the items of the output list. It has no
checksum and no clock: what keeps the parser in step is the blank or line end that the list must end with, and that
the numbers can be a pose.
"""

import re
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from devices.errors import DeviceError, SettingError
from devices.protocols._conversation import COMMON_BAUDS, CommandLine, Question, find_baud
from devices.protocols._framing import DROP_ONE, WAIT, FramedProtocol, Scan, drop_until
from devices.protocols._poses import INCH_M, POOR_QUALITY
from devices.protocols._records import Item, RecordLayout
from devices.protocols.protocol import Drain, Receive, Script, SimulatedDevice, Step, Write
from devices.sample import SampleFlag, TrackerSample

ITEMS: Mapping[int, Item] = {
    0: Item("literal", literal=b" "),
    1: Item("literal", literal=b"\r\n"),
    2: Item("position", "3f", decimals=2),
    4: Item("euler", "3f", decimals=2),
    11: Item("quaternion", "4f", decimals=4),
}
FACTORY_ITEMS: tuple[int, ...] = (2, 4, 1)

WEAK_SIGNAL = "xjk"
"""Error letters that say the position itself is poor: outside the box, signal saturated, signal low."""

_STATUS = re.compile(rb"2.S[0-9A-Fa-f]{3}")
_REINITIALISE = b"\x19"
_TRIES_BEFORE_RESET = 3


@dataclass
class Fastrak(FramedProtocol):
    """A FASTRAK with up to four receivers.

    binary: 32-byte records and full resolution; text is for looking at by eye (0.1 mm in centimetres).
    inches: unit on the wire. items: the output list; it must end in 0 (blank) or 1 (line end).
    hemisphere: direction (x, y, z) of the half of space the receivers stay in, in the transmitter's axes;
    empty leaves what the device has stored.
    """

    name: ClassVar[str] = "fastrak"
    title: ClassVar[str] = "Polhemus FASTRAK"
    rate_hz: ClassVar[float] = 30.0
    max_trackers: ClassVar[int] = 4
    filters_itself: ClassVar[bool] = True

    stations: ClassVar[str] = "1234"
    table: ClassVar[Mapping[int, Item]] = ITEMS
    endings: ClassVar[tuple[int, ...]] = (0, 1)
    flagging: ClassVar[bool] = True
    """Whether the third character can be an error letter."""

    binary: bool = True
    inches: bool = False
    items: tuple[int, ...] = (2, 11, 0)
    hemisphere: tuple[float, ...] = ()
    _unanswered: int = field(default=0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self.items, self.hemisphere = tuple(self.items), tuple(self.hemisphere)
        if not self.items or self.items[-1] not in self.endings:
            endings = " or ".join(map(str, self.endings))
            raise SettingError(f"{self.name}: output list {self.items} must end in {endings}, to find its records by")
        self._layout = RecordLayout(self.items, self.table, "2ss", self.binary)

    @property
    def unit_m(self) -> float:
        """Metres in one unit of the wire."""
        return INCH_M if self.inches else 0.01

    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        if buffer[start] != 0x30:
            return drop_until(buffer, start, b"0")
        if len(buffer) - start < self._layout.size:
            return WAIT
        station, error = chr(buffer[start + 1]), chr(buffer[start + 2])
        good = error == " " or (self.flagging and error.isascii() and error.isalpha())
        if station not in self.stations or not good:
            return DROP_ONE
        values = self._layout.values(buffer, start)
        pose = values and self._layout.pose(values, self.unit_m)
        if not values or not pose:
            self.counters.bad_frames += 1
            return DROP_ONE
        time_ms = self._layout.value(values, "time_ms")
        sample = TrackerSample(
            tracker=str(int(station, 16)),
            host_time_ns=host_time_ns,
            position=pose[0],
            orientation=pose[1],
            device_time_s=None if time_ms is None else time_ms / 1000,
            quality=POOR_QUALITY if error in WEAK_SIGNAL else None,
            flags=SampleFlag.NONE if error == " " else SampleFlag.SUSPECT,
        )
        return self._layout.size, [sample]

    def start(self) -> Script:
        hint = "check its power, the null-modem cable, and the I/O switches (8 data bits, no parity)"
        yield from find_baud(self, COMMON_BAUDS, self._status, hint)
        for station in (yield from self._active_stations()):
            yield Write(f"O{station},{','.join(map(str, self.items))}\r".encode())
            if self.hemisphere:
                yield Write(f"H{station},{','.join(f'{x:g}' for x in self.hemisphere)}\r".encode())
        yield Write(b"U" if self.inches else b"u")
        if b"*ERROR*" in (yield Receive(0.2, until=b"*ERROR* EC")):
            raise DeviceError(f"{self.title} refuses the output list {self.items} or hemisphere {self.hemisphere}")
        yield Write(b"f" if self.binary else b"F")
        yield Write(b"C")

    def stop(self) -> Script:
        yield Write(b"c")
        yield Drain()

    def recover(self) -> Script:
        """Starts again; a device that does not answer some times is re-initialised once, which takes it ten seconds."""
        try:
            yield from self.start()
            self._unanswered = 0
        except DeviceError:
            self._unanswered += 1
            if self._unanswered == _TRIES_BEFORE_RESET:
                yield Write(_REINITIALISE)
            raise

    def _status(self) -> Question:
        """Ends a half-typed command and a stream left on by a crash, then asks for the status record."""
        yield Write(b"\rc")
        yield Drain()
        yield Write(b"S")
        return bool(_STATUS.search((yield Receive(0.5, until=b"\r\n"))))

    def _active_stations(self) -> Generator[Step, bytes, Sequence[str]]:
        """The stations that are on, asked of station 1; all of them where the device does not say."""
        yield Write(b"l1\r")
        reply = re.search(rb"2.l([01]+)\r\n", (yield Receive(0.5, until=b"\r\n")))
        if not reply:
            return self.stations
        active = [s for s, on in zip(self.stations, reply[1].decode(), strict=False) if on == "1"]
        if not active:
            raise DeviceError(f"{self.title} has no receiver switched on: plug one in, or switch its station on")
        return active

    def simulator(self, roles: Sequence[str]) -> "SimulatedFastrak":
        return SimulatedFastrak(self, len(roles), status="2.14  3SPACE FASTRAK", status_size=55)


class SimulatedFastrak(SimulatedDevice):
    """A FASTRAK fresh from the factory: text, inches, `2,4,1`, silent until asked."""

    immediate: ClassVar[str] = "PCcFfUuSTXW\x0b\x19\x11\x13"

    def __init__(self, protocol: Fastrak, trackers: int, status: str, status_size: int) -> None:
        self._status_text, self._status_size = status, status_size
        self._table = protocol.table
        self._stations = protocol.stations[:trackers]
        self._all_stations = protocol.stations
        self._line = CommandLine(self.immediate)
        self._samples: Sequence[TrackerSample] = ()
        self._to_factory()

    def _to_factory(self) -> None:
        self.streaming, self.binary, self.inches = False, False, True
        self.items = dict.fromkeys(self._all_stations, FACTORY_ITEMS)

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._samples = samples
        return self._records() if self.streaming else []

    def answer(self, data: bytes) -> bytes:
        return b"".join(map(self._answer, self._line.commands(data)))

    def _answer(self, command: str) -> bytes:
        match command[0]:
            case "P":
                return b"".join(self._records())
            case "C" | "c":
                self.streaming = command == "C"
            case "F" | "f":
                self.binary = command == "f"
            case "U" | "u":
                self.inches = command == "U"
            case "W" | "\x19":
                self._to_factory()
            case "S":
                return self._status()
            case "l" if "," not in command:
                on = "".join("01"[station in self._stations] for station in self._all_stations)
                return f"2{command[1:2] or '1'}l{on}\r\n".encode()
            case "O":
                return self._set_items(command)
        return b""

    def _set_items(self, command: str) -> bytes:
        station, _, items = command[1:].partition(",")
        try:
            numbers = tuple(int(item) for item in items.split(","))
            RecordLayout(numbers, self._table, "2ss")
        except (ValueError, SettingError):
            return f"2 E*ERROR* {command}\r\n*ERROR* EC -3 *PS 0 *FL 0 *ST {station}\r\n".encode()
        self.items[station] = numbers
        return b""

    def _status(self) -> bytes:
        flags = 0x3F0 | self.binary | (not self.inches) << 1 | self.streaming << 3
        text = f"2{self._stations[:1] or '1'}S{flags:03X}  0 F3   {self._status_text}"
        return text.ljust(self._status_size - 2).encode() + b"\r\n"

    def _records(self) -> list[bytes]:
        """One record for each receiver that is seen; one unplugged sends nothing."""
        unit = INCH_M if self.inches else 0.01
        records = []
        for station, sample in zip(self._stations, self._samples, strict=False):
            if sample.position is not None:
                layout = RecordLayout(self.items[station], self._table, "2ss", self.binary)
                time_ms = round(1000 * (sample.device_time_s or 0.0))
                records.append(layout.encode((f"0{station}".encode(), b" "), sample, unit, {"time_ms": time_ms}))
        return records
