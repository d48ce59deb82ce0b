"""Decawave / Qorvo DWM1001 with its stock firmware: position only, as lines of text or as polled binary values.

Sources: the PANS API guide; the pydwm1001 package.

A tag prints its own position; a listener or gateway prints that of every tag it hears, which is how several trackers
come through one port. There is no checksum: a line must have exactly the documented form.
"""

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from devices.axes import Axes
from devices.errors import DeviceError
from devices.protocols._framing import DROP_ONE, WAIT, FramedProtocol, Scan, drop_until
from devices.protocols._poses import plausible_position
from devices.protocols.protocol import Drain, Pause, Receive, Script, SimulatedDevice, Write
from devices.sample import SampleFlag, TrackerSample

AXES = Axes("RFU")
"""The anchors' frame: z up."""

_NUMBER = rb"(-?\d{1,3}\.\d{2}|nan)"
_LINE = re.compile(rb"POS,(?:(\d{1,3}),([0-9A-F]{4}),)?%s,%s,%s,(\d{1,3})(?:,x[0-9A-F]{2})?\r" % ((_NUMBER,) * 3))
_LONGEST_LINE = 512
"""`DIST` lines with many anchors are the longest."""

_POSITION_REQUEST = b"\x02\x00"
_TLV = struct.Struct("<5siiiB")
_TLV_HEAD = b"\x40\x01\x00\x41\x0d"
_POLL_NS = 100_000_000
_PROMPT = b"dwm> "
_QUIT = b"\rquit\r"


@dataclass
class Dwm1001(FramedProtocol):
    """A tag, listener or gateway. binary: poll one tag with the binary API instead of reading the shell's lines."""

    name: ClassVar[str] = "dwm1001"
    title: ClassVar[str] = "Decawave / Qorvo DWM1001"
    rate_hz: ClassVar[float] = 10.0
    max_trackers: ClassVar[int] = 15
    filters_itself: ClassVar[bool] = True

    binary: bool = False
    _polled_ns: int | None = field(default=None, init=False, repr=False, compare=False)

    def reset(self) -> None:
        super().reset()
        self._polled_ns = None

    def to_send(self, host_time_ns: int) -> bytes:
        if not self.binary or (self._polled_ns is not None and host_time_ns - self._polled_ns < _POLL_NS):
            return b""
        self._polled_ns = host_time_ns
        return _POSITION_REQUEST

    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        scan = self._scan_binary if self.binary else self._scan_line
        return scan(buffer, start, host_time_ns)

    def _scan_binary(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        head = buffer[start : start + len(_TLV_HEAD)]
        if not _TLV_HEAD.startswith(head):
            return drop_until(buffer, start, _TLV_HEAD)
        if len(buffer) - start < _TLV.size:
            return WAIT
        _, x, y, z, quality = _TLV.unpack_from(buffer, start)
        position = (x / 1000, y / 1000, z / 1000)
        if quality > 100 or not plausible_position(position):
            self.counters.bad_frames += 1
            return DROP_ONE
        return _TLV.size, [_sample("1", position, quality, host_time_ns)]

    def _scan_line(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        """A line up to its CR LF; of a broken line, what follows its last `POS`."""
        window = buffer[start : start + _LONGEST_LINE]
        end = window.find(b"\n")
        if end < 0:
            return WAIT if len(window) < _LONGEST_LINE else DROP_ONE
        line = window[: end + 1]
        match = _LINE.fullmatch(line, max(0, line.rfind(b"POS,")), end)
        if not match:
            if b"POS" not in line:
                return len(line), []  # an echo, a prompt, what other commands print
            self.counters.bad_frames += 1
            return len(line), None
        _, tag, x, y, z, quality = match.groups()
        position = (float(x), float(y), float(z))
        tracker = tag.decode() if tag else "1"
        if int(quality) > 100:
            return len(line), None
        return len(line), [_sample(tracker, position, int(quality), host_time_ns)]

    def start(self) -> Script:
        yield Drain(silence_s=0.05, timeout_s=0.2)
        if self.binary:
            yield from self._leave_shell()
            return
        for _ in range(2):
            yield Write(b"\r")
            yield Pause(0.1)
        heard = yield Receive(1.0, until=_PROMPT)
        if not heard:
            raise DeviceError(f"no answer from {self.title}: check that it runs the stock firmware, at 115200 baud")
        # One word switches printing on and off, and printing goes on by itself when the shell is entered again.
        heard += yield Receive(0.4, until=b"POS,")
        if b"POS," not in heard:
            yield Write(b"lep\r")

    def stop(self) -> Script:
        """Leaves the shell, and with it the printing."""
        if not self.binary:
            yield Write(_QUIT)
            yield Drain()

    def _leave_shell(self) -> Script:
        """In the shell, where a crash may have left it, the device does not know binary requests."""
        yield Write(_POSITION_REQUEST)
        if not (yield Receive(0.5, size=_TLV.size)).startswith(b"\x40"):
            yield Write(_QUIT)
            yield Drain()

    def simulator(self, roles: Sequence[str]) -> "SimulatedDwm1001":
        return SimulatedDwm1001(len(roles))


def _sample(tracker: str, position: tuple[float, float, float], quality: int, host_time_ns: int) -> TrackerSample:
    """A position in the anchors' frame; `nan` is a tag without a fix."""
    if not plausible_position(position):
        return TrackerSample(tracker, host_time_ns, quality=0.0, flags=SampleFlag.SUSPECT)
    return TrackerSample(tracker, host_time_ns, AXES.to_rub(position), quality=quality / 100)


class SimulatedDwm1001(SimulatedDevice):
    """A tag (one tracker) or a listener (several), powered up in its binary mode.

    The listener's tags have the IDs "0001", "0002", ...
    """

    def __init__(self, trackers: int) -> None:
        self._trackers = trackers
        self._samples: Sequence[TrackerSample] = ()
        self._typed = b""
        self._shell, self._printing = False, False
        self.streaming = False

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._samples = samples
        if not self._shell or not self.streaming:
            return []
        return [self._line(n, sample) for n, sample in enumerate(samples) if sample.position is not None]

    def answer(self, data: bytes) -> bytes:
        self._typed += data
        replies = self._answer_shell() if self._shell else self._answer_binary()
        if self._shell:
            self.streaming = self._printing
        return replies

    def _answer_binary(self) -> bytes:
        if b"\r\r" in self._typed:
            self._shell, self._typed = True, b""
            return b"\r\n DWM1001 TWR Real Time Location System\r\n\r\n" + _PROMPT
        replies = b""
        while _POSITION_REQUEST in self._typed:
            self._typed = self._typed.partition(_POSITION_REQUEST)[2]
            self.streaming = True
            replies += self._tlv()
        return replies

    def _answer_shell(self) -> bytes:
        replies = b""
        while b"\r" in self._typed:
            command, _, self._typed = self._typed.partition(b"\r")
            if command == b"lep":
                self._printing = not self._printing
            elif command == b"quit":
                self._shell, self.streaming = False, False
                return replies + command + b"\r\n"
            replies += command + b"\r\n" + _PROMPT
        return replies

    def _line(self, number: int, sample: TrackerSample) -> bytes:
        place = ",".join(f"{value:.2f}" for value in AXES.from_rub(sample.position or (0.0, 0.0, 0.0)))
        quality = round(100 * (1.0 if sample.quality is None else sample.quality))
        if self._trackers == 1:
            return f"POS,{place},{quality}\r\n".encode()
        return f"POS,{number},{number + 1:04X},{place},{quality},x00\r\n".encode()

    def _tlv(self) -> bytes:
        sample = self._samples[0] if self._samples else None
        if sample is None or sample.position is None:
            return b"\x40\x01\x02"
        x, y, z = (round(1000 * value) for value in AXES.from_rub(sample.position))
        quality = round(100 * (1.0 if sample.quality is None else sample.quality))
        return _TLV.pack(_TLV_HEAD, x, y, z, quality)
