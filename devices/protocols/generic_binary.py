"""The generic binary format on a serial line: COBS frames between zero bytes, each a record and its CRC.

COBS: Cheshire and Baker, Consistent Overhead Byte Stuffing, IEEE/ACM Transactions on Networking 7 (2), 1999.
CRC-16/CCITT-FALSE (polynomial 0x1021, initial 0xFFFF), little-endian, over the record.
"""

from binascii import crc_hqx
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from cobs import cobs

from devices.axes import Axes
from devices.protocols.generic_records import (
    COMMAND,
    COMMAND_TYPE,
    INFO,
    INFO_TYPE,
    QUERY,
    SAMPLE,
    SAMPLE_TYPE,
    START,
    STOP,
    DeviceInfo,
    RecordReader,
    encode_sample,
)
from devices.protocols.protocol import DeviceProtocol, Drain, Receive, Script, SerialFormat, SimulatedDevice, Write
from devices.sample import TrackerSample

_LONGEST_FRAME = 64
_CRC_START = 0xFFFF


def frame(record: bytes) -> bytes:
    """A record on the wire: COBS of it and its CRC, and a zero byte."""
    return cobs.encode(record + crc_hqx(record, _CRC_START).to_bytes(2, "little")) + b"\0"


def record_in(stuffed: bytes) -> bytes | None:
    """The record between two zero bytes, None where it is none."""
    try:
        checked = cobs.decode(stuffed)
    except cobs.DecodeError:
        return None
    if len(checked) < 3 or crc_hqx(checked[:-2], _CRC_START) != int.from_bytes(checked[-2:], "little"):
        return None
    return checked[:-2]


@dataclass
class GenericBinary(DeviceProtocol):
    """axes: the device's frame, see `devices.axes`; its own info record overrides it."""

    name: ClassVar[str] = "generic-binary"
    title: ClassVar[str] = "Generic binary records (COBS)"
    serial: ClassVar[SerialFormat] = SerialFormat(baud=460800)
    max_trackers: ClassVar[int] = 255

    axes: str = "RUB"
    _part: bytes = field(default=b"", init=False, repr=False)

    def __post_init__(self) -> None:
        self._reader = RecordReader(Axes(self.axes), self.counters)

    def reset(self) -> None:
        super().reset()
        self._part = b""
        self._reader = RecordReader(Axes(self.axes), self.counters)

    def feed(self, data: bytes, host_time_ns: int) -> list[TrackerSample]:
        *frames, rest = (self._part + data).split(b"\0")
        # More than the longest frame is kept: one that is too long must not end in one that looks right.
        self._part = rest[-2 * _LONGEST_FRAME :]
        self.counters.bytes_dropped += len(rest) - len(self._part)
        samples = []
        for stuffed in frames:
            sample = self._frame(stuffed, host_time_ns) if stuffed else None
            if sample is not None:
                samples.append(sample)
        return samples

    def _frame(self, stuffed: bytes, host_time_ns: int) -> TrackerSample | None:
        record = record_in(stuffed) if len(stuffed) <= _LONGEST_FRAME else None
        if record is None:
            self.counters.bad_frames += 1
            self.counters.bytes_dropped += len(stuffed) + 1
        elif record[0] == SAMPLE_TYPE and len(record) == SAMPLE.size:
            return self._reader.sample(record, host_time_ns)
        elif record[0] == INFO_TYPE:
            info = DeviceInfo.decode(record)
            if info is not None:
                self.axes, self._reader.axes = info.axes, Axes(info.axes)
        return None

    def start(self) -> Script:
        """Ask what it is, take its axes from the answer, then start; a device may stream unasked."""
        yield Write(b"\0")
        yield Drain(0.02, 0.2)
        yield Write(frame(COMMAND.pack(COMMAND_TYPE, QUERY, 0)))
        self.feed((yield Receive(0.3, size=INFO.size + 5)), 0)
        yield Write(frame(COMMAND.pack(COMMAND_TYPE, START, round(self.rate_hz))))

    def stop(self) -> Script:
        yield Write(frame(COMMAND.pack(COMMAND_TYPE, STOP, 0)))

    def simulator(self, roles: Sequence[str]) -> "SimulatedGenericBinary":
        return SimulatedGenericBinary(DeviceInfo(len(roles), round(self.rate_hz), self.axes, "sixpoint", "SIM1"))


@dataclass
class SimulatedGenericBinary(SimulatedDevice):
    """Streams from the start, as a device may; obeys commands."""

    info: DeviceInfo
    streaming: bool = True
    _part: bytes = b""
    _sequence: int = -1

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._sequence += 1
        axes = Axes(self.info.axes)
        return [frame(encode_sample(s, self._sequence, axes)) for s in samples] if self.streaming else []

    def answer(self, data: bytes) -> bytes:
        *frames, self._part = (self._part + data).split(b"\0")
        return b"".join(self._obey(record_in(stuffed) or b"") for stuffed in frames)

    def _obey(self, record: bytes) -> bytes:
        if len(record) != COMMAND.size or record[0] != COMMAND_TYPE:
            return b""
        if record[1] == QUERY:
            return b"\0" + frame(self.info.encode())
        self.streaming = record[1] == START
        return b""
