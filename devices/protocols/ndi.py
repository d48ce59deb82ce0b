"""NDI Polaris and Aurora on a serial port: the Combined API, polled with BX (binary) or TX (text).

Sources: the open ndicapi library; the VRPN driver for Polaris.

Every command and every text reply ends in four hex digits of a CRC-16/ARC and CR. A BX reply has a checked header and
a checked body, so that nothing wrong comes through. The reply to one poll is what makes the next poll due.
"""

import re
import struct
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from devices.axes import Axes
from devices.errors import DeviceError, FileError, SettingError, choice_error
from devices.protocols._crc import crc16
from devices.protocols._framing import DROP_ONE, WAIT, FramedProtocol, Scan
from devices.protocols._poses import IDENTITY, plausible_position, unit_quaternion
from devices.protocols.counters import Unwrapped
from devices.protocols.protocol import (
    Break,
    Drain,
    Pause,
    Receive,
    Script,
    SerialFormat,
    SetBaud,
    SimulatedDevice,
    Step,
    Write,
)
from devices.sample import SampleFlag, TrackerSample

BX_MARK = b"\xc4\xa5"
VALID, MISSING, DISABLED = 1, 2, 4
"""Handle status in a BX reply."""

IN_PORT, INITIALISED, ENABLED, OUT_OF_VOLUME = 0x01, 0x10, 0x20, 0x40
"""Port status bits."""

_BX_HEAD = struct.Struct("<2sHH")
_TRANSFORM = struct.Struct("<8f")
_STATUS = struct.Struct("<II")
_LARGEST_BODY = 2048
_LONGEST_TEXT = 4096
_TX_LINE = re.compile(
    rb"([0-9A-F]{2})(?:((?:[+-]\d{5}){4})((?:[+-]\d{6}){3})[+-]\d{5}|MISSING)([0-9A-F]{8})([0-9A-F]{8})\n"
    rb"|[0-9A-F]{2}(?:DISABLED|UNOCCUPIED)[0-9A-F]*\n"
)
_POWER_UP_BAUD = 9600
_BAUD_DIGITS = {9600: "0", 14400: "1", 19200: "2", 38400: "3", 57600: "4", 115200: "5", 921600: "6", 230400: "A"}
_ROM_CHUNK = 64
_PROMPT_S, _PATIENT_S = 0.7, 5.0
"""How long a reply may take; starting up the sensors or reading a tool's memory can take seconds."""

_POLL_AGAIN_NS = 250_000_000
_FASTEST_POLL_NS = 8_000_000

Answer = Generator[Step, bytes, bytes]


def with_crc(text: bytes) -> bytes:
    """A command or reply with its CRC and CR: `TSTART:` gives `TSTART:5423` CR."""
    return text + f"{crc16(text):04X}\r".encode()


@dataclass
class Ndi(FramedProtocol):
    """A Polaris or Aurora with its tools.

    binary: poll with BX, else with TX. frame_hz: how fast its frame number counts (Polaris 60, Aurora 40).
    axes: three letters for the camera's or field generator's frame as it is mounted. tool_roms: paths of the `.rom`
    files of passive (wireless) tools; wired tools carry their own. line_baud: speed that the device is switched to.
    """

    name: ClassVar[str] = "ndi"
    title: ClassVar[str] = "NDI Polaris / Aurora"
    serial: ClassVar[SerialFormat] = SerialFormat(baud=115200)
    rate_hz: ClassVar[float] = 60.0
    max_trackers: ClassVar[int] = 16

    binary: bool = True
    frame_hz: float = 60.0
    axes: str = "RUB"
    tool_roms: tuple[str, ...] = ()
    line_baud: int = 115200
    _clock: Unwrapped = field(default_factory=lambda: Unwrapped(1 << 32), init=False, repr=False, compare=False)
    _last_frame: dict[int, int] = field(default_factory=dict, init=False, repr=False, compare=False)
    _polled_ns: int | None = field(default=None, init=False, repr=False, compare=False)
    _answered: bool = field(default=True, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self.tool_roms = tuple(self.tool_roms)
        if not self.frame_hz > 0:
            raise SettingError(f"frame_hz is {self.frame_hz}: it must be above 0, as 60 for Polaris or 40 for Aurora")
        if self.line_baud not in _BAUD_DIGITS:
            raise choice_error("line_baud", self.line_baud, _BAUD_DIGITS)
        self._frame = Axes(self.axes)
        self._poll = with_crc(b"BX:0001" if self.binary else b"TX:0001")

    def reset(self) -> None:
        super().reset()
        self._clock = Unwrapped(1 << 32)
        self._last_frame = {}
        self._polled_ns, self._answered = None, True

    def to_send(self, host_time_ns: int) -> bytes:
        """The next poll, once the last one is answered, or lost."""
        if self._polled_ns is not None:
            waited = host_time_ns - self._polled_ns
            if waited < (_FASTEST_POLL_NS if self._answered else _POLL_AGAIN_NS):
                return b""
        self._polled_ns, self._answered = host_time_ns, False
        return self._poll

    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        if buffer.startswith(BX_MARK, start):
            return self._scan_binary(buffer, start, host_time_ns)
        return self._scan_text(buffer, start, host_time_ns)

    def _scan_binary(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        ready = len(buffer) - start
        if ready < _BX_HEAD.size:
            return WAIT
        _, length, head_crc = _BX_HEAD.unpack_from(buffer, start)
        if crc16(buffer[start : start + 4]) != head_crc or length > _LARGEST_BODY:
            self.counters.bad_frames += 1
            return DROP_ONE
        size = _BX_HEAD.size + length + 2
        if ready < size:
            return WAIT
        body = buffer[start + _BX_HEAD.size : start + size - 2]
        if crc16(body) != int.from_bytes(buffer[start + size - 2 : start + size], "little"):
            self.counters.bad_frames += 1
            return DROP_ONE
        self._answered = True
        try:
            return size, self._binary_samples(body, host_time_ns)
        except (struct.error, IndexError):
            self.counters.bad_frames += 1
            return size, None

    def _binary_samples(self, body: bytes, host_time_ns: int) -> list[TrackerSample]:
        samples = []
        at = 1
        for _ in range(body[0]):
            handle, status = body[at], body[at + 1]
            at += 2
            transform = None
            if status == VALID:
                transform = _TRANSFORM.unpack_from(body, at)[:7]
                at += _TRANSFORM.size
            if status != DISABLED:
                port, frame = _STATUS.unpack_from(body, at)
                at += _STATUS.size
                samples += self._sample(handle, transform, port, frame, host_time_ns)
        return samples

    def _scan_text(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        """A reply up to its CR, or what stands before the mark of a binary one."""
        window = buffer[start : start + _LONGEST_TEXT]
        end, mark = window.find(b"\r"), window.find(BX_MARK)
        if mark >= 0 and (end < 0 or mark < end):
            return mark, None
        if end < 0:
            return WAIT if len(window) < _LONGEST_TEXT else (len(window) - 1, None)
        line = window[: end + 1]
        if len(line) < 5 or with_crc(line[:-5]) != line:
            self.counters.bad_frames += 1
            return len(line), None
        if line.startswith((b"ERROR", b"RESET")):
            # Not answered: the next poll waits, lest an unready device is asked a thousand times a second.
            return len(line), []
        self._answered = True
        return len(line), self._text_samples(line, host_time_ns)

    def _text_samples(self, line: bytes, host_time_ns: int) -> list[TrackerSample]:
        samples = []
        for match in _TX_LINE.finditer(line, 2):
            handle, turn, place, port, frame = match.groups()
            if handle is None:
                continue
            transform = None
            if turn is not None:
                transform = (
                    *(int(turn[i : i + 6]) * 1e-4 for i in range(0, 24, 6)),
                    *(int(place[i : i + 7]) * 0.01 for i in range(0, 21, 7)),
                )
            samples += self._sample(int(handle, 16), transform, int(port, 16), int(frame, 16), host_time_ns)
        return samples

    def _sample(
        self, handle: int, transform: tuple | None, port: int, frame: int, host_time_ns: int
    ) -> list[TrackerSample]:
        """The sample of one tool; none where this frame was polled before. transform: w, x, y, z, then millimetres."""
        if self._last_frame.get(handle) == frame:
            return []
        self._last_frame[handle] = frame
        position = turn = None
        if transform is not None:
            w, x, y, z = transform[:4]
            turn = unit_quaternion((x, y, z, w))
            position = (transform[4] / 1000, transform[5] / 1000, transform[6] / 1000)
            if not plausible_position(position):
                position = None
        return [
            TrackerSample(
                tracker=str(handle),
                host_time_ns=host_time_ns,
                position=position and self._frame.to_rub(position),
                orientation=turn and self._frame.quaternion_to_rub(turn),
                device_time_s=self._clock(frame) / self.frame_hz,
                sequence=frame,
                flags=SampleFlag.SUSPECT if port & OUT_OF_VOLUME else SampleFlag.NONE,
            )
        ]

    def start(self) -> Script:
        yield from self._reach()
        yield from self._free_stale_handles()
        for path in self.tool_roms:
            yield from self._load_tool(path)
        for handle in (yield from self._handles(b"02")):
            yield from self._must(b"PINIT:" + handle)
        for handle in (yield from self._handles(b"03")):
            yield from self._must(b"PENA:" + handle + b"D")
        if not (yield from self._handles(b"04")):
            raise DeviceError(f"{self.title} has no tool: plug one in, or name a passive tool's file in tool_roms")
        yield from self._must(b"TSTART:")

    def stop(self) -> Script:
        yield Drain()
        yield from self._ask(b"TSTOP:", _PROMPT_S)

    def _reach(self) -> Script:
        """Brings the line to `baud` and the device to its initialised state, from whatever state both are in."""
        yield SetBaud(self.line_baud)
        if (yield from self._initialise()):
            return
        yield SetBaud(_POWER_UP_BAUD)
        yield Break()
        yield Receive(2.0, until=b"\r")
        if not (yield from self._initialise()):
            raise DeviceError(
                f"no answer from {self.title} at {self.line_baud} or {_POWER_UP_BAUD} baud: check its power and cable"
            )
        yield from self._must(f"COMM:{_BAUD_DIGITS[self.line_baud]}0000".encode())
        yield Pause(0.1)
        yield SetBaud(self.line_baud)

    def _initialise(self) -> Generator[Step, bytes, bool]:
        """Ends a half-typed command and tracking left on by a crash; whether the device says it is initialised."""
        yield Write(b"\r")
        yield Drain()
        if not (yield from self._ask(b"TSTOP:", _PROMPT_S)):
            return False
        return (yield from self._ask(b"INIT:")).startswith(b"OKAY")

    def _free_stale_handles(self) -> Script:
        for handle in (yield from self._handles(b"01")):
            yield from self._must(b"PHF:" + handle)

    def _load_tool(self, path: str) -> Script:
        """Gives a passive tool a handle and writes its description into it, 64 bytes at a time."""
        try:
            rom = Path(path).read_bytes()
        except OSError as error:
            raise FileError(
                f"tool file {path}: {error.strerror}; set tool_roms to the .rom files of your tools"
            ) from None
        handle = (yield from self._must(b"PHRQ:*********1****"))[:2]
        for at in range(0, len(rom), _ROM_CHUNK):
            chunk = rom[at : at + _ROM_CHUNK].ljust(_ROM_CHUNK, b"\0")
            yield from self._must(b"PVWR:" + handle + f"{at:04X}{chunk.hex().upper()}".encode())

    def _handles(self, which: bytes) -> Generator[Step, bytes, list[bytes]]:
        """Port handles to free (01), to initialise (02), to enable (03), or enabled (04)."""
        reply = yield from self._must(b"PHSR:" + which)
        return [reply[at : at + 2] for at in range(2, len(reply) - 4, 5)]

    def _ask(self, command: bytes, timeout_s: float = _PATIENT_S) -> Answer:
        """The checked reply to a command without CRC and CR; b"" where there is none."""
        yield Write(with_crc(command))
        reply = yield Receive(timeout_s, until=b"\r")
        line = reply[: reply.find(b"\r") + 1]
        return line[:-5] if line and with_crc(line[:-5]) == line else b""

    def _must(self, command: bytes) -> Answer:
        reply = yield from self._ask(command)
        if not reply or reply.startswith(b"ERROR"):
            said = reply.decode() or "nothing"
            raise DeviceError(f"{self.title} answers {command.decode()} with {said}: check its tools and its manual")
        return reply

    def simulator(self, roles: Sequence[str]) -> "SimulatedNdi":
        return SimulatedNdi(len(roles), self._frame)


class SimulatedNdi(SimulatedDevice):
    """A measurement system with wired tools, just switched on. It follows no line speed: any is understood."""

    def __init__(self, tools: int, axes: Axes) -> None:
        self._axes = axes
        self._ports = dict.fromkeys(range(1, tools + 1), IN_PORT)
        self._pending = b""
        self._samples: Sequence[TrackerSample] = ()
        self._number = 0
        self.streaming = False

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._samples = samples
        self._number = (self._number + 1) % (1 << 32)
        return []

    def answer(self, data: bytes) -> bytes:
        *commands, self._pending = (self._pending + data).split(b"\r")
        return b"".join(self._answer(command) for command in commands)

    def _answer(self, command: bytes) -> bytes:
        if b":" in command:
            if with_crc(command[:-4]) != command + b"\r":
                return with_crc(b"ERROR04")
            command = command[:-4]
        verb, _, given = command.replace(b" ", b":", 1).partition(b":")
        match verb:
            case b"BX" | b"TX":
                if not self.streaming:
                    return with_crc(b"ERROR0C")
                return self._binary_reply() if verb == b"BX" else self._text_reply()
            case b"PHSR":
                return with_crc(self._handles(given))
            case b"PINIT" | b"PENA":
                return self._set_port(given[:2], INITIALISED if verb == b"PINIT" else ENABLED)
            case b"INIT" | b"COMM" | b"TSTART" | b"TSTOP":
                self.streaming = verb == b"TSTART" or (self.streaming and verb == b"COMM")
                return with_crc(b"OKAY")
            case b"RESET":
                self.streaming = False
                self._ports = dict.fromkeys(self._ports, IN_PORT)
                return with_crc(b"RESET")
        return with_crc(b"ERROR01")

    def _handles(self, which: bytes) -> bytes:
        wanted = {b"02": IN_PORT, b"03": IN_PORT | INITIALISED, b"04": IN_PORT | INITIALISED | ENABLED}.get(which)
        found = [(handle, status) for handle, status in self._ports.items() if status == wanted]
        return f"{len(found):02X}".encode() + b"".join(f"{h:02X}{s:03X}".encode() for h, s in found)

    def _set_port(self, handle: bytes, bit: int) -> bytes:
        number = int(handle, 16) if re.fullmatch(rb"[0-9A-F]{2}", handle) else 0
        if number not in self._ports:
            return with_crc(b"ERROR08")
        self._ports[number] |= bit
        return with_crc(b"OKAY")

    def _tools(self) -> list[tuple[int, int, tuple[float, ...] | None]]:
        """(handle, port status, w x y z and millimetres, or None where it is not seen) of the enabled tools."""
        tools = []
        for (handle, status), sample in zip(self._ports.items(), self._samples, strict=False):
            if status & ENABLED:
                tools.append((handle, status, self._transform(sample)))
        return tools

    def _transform(self, sample: TrackerSample) -> tuple[float, ...] | None:
        if sample.position is None:
            return None
        x, y, z, w = self._axes.quaternion_from_rub(sample.orientation or IDENTITY)
        return (w, x, y, z, *(1000 * value for value in self._axes.from_rub(sample.position)))

    def _binary_reply(self) -> bytes:
        tools = self._tools()
        body = bytes((len(tools),))
        for handle, status, transform in tools:
            body += bytes((handle, VALID if transform else MISSING))
            body += _TRANSFORM.pack(*transform, 0.0) if transform else b""
            body += _STATUS.pack(status, self._number)
        body += bytes(2)
        head = BX_MARK + len(body).to_bytes(2, "little")
        return head + crc16(head).to_bytes(2, "little") + body + crc16(body).to_bytes(2, "little")

    def _text_reply(self) -> bytes:
        tools = self._tools()
        text = f"{len(tools):02X}"
        for handle, status, transform in tools:
            text += (
                f"{handle:02X}{_tx_transform(transform) if transform else 'MISSING'}{status:08X}{self._number:08X}\n"
            )
        return with_crc(f"{text}0000".encode())


def _tx_transform(transform: tuple[float, ...]) -> str:
    turn = "".join(f"{round(value * 1e4):+06d}" for value in transform[:4])
    place = "".join(f"{round(value * 100):+07d}" for value in transform[4:])
    return f"{turn}{place}+00000"
