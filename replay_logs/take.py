"""Takes: MCAP files of raw device bytes with host time, decoded samples for other tools, and what made them.

One channel a device, `/devices/<name>/raw`, holds the bytes as they came; its channel metadata names the protocol, its
options, which tracker is on which role, and where the device stands. Samples are decoded from these bytes whenever a
take is read, so they are what the live session saw. Settings that were changed meanwhile stand on `/settings`, between
the bytes before and after. The `/trackers/...` channels repeat them as `foxglove.PoseInFrame`
for viewers. A metadata record `sixpoint` holds the session's configuration, the calibration and the software version.
"""

import json
import struct
import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import IO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, Metadata
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from devices.axes import Quaternion, Vector
from devices.driver import RawChunk
from devices.errors import FileError, SettingError
from devices.filters import GateSettings, OneEuroSettings
from devices.intake import DeviceIntake, RoleReading
from devices.intake_settings import write_setting
from devices.protocols import make_protocol
from devices.protocols.protocol import DeviceProtocol
from devices.room import RoomTransform
from devices.sample import TrackerSample

METADATA_NAME = "sixpoint"
RAW_ENCODING = "x-sixpoint-raw"
MARKS_TOPIC = "/marks"
SETTINGS_TOPIC = "/settings"
_RECORD_HEAD = struct.Struct("<BQ")
_FIRST_PRIVATE_OPCODE = 0x80
"""From here on applications may have records of their own (MCAP specification, "Opcodes")."""


@dataclass(frozen=True, slots=True)
class RecordedDevice:
    """What a take says of one of its devices.

    options: of its protocol. assignment: tracker -> role. room: where it stood. gate, smoothing: what was done against
    outliers and noise.
    """

    name: str
    protocol: str
    options: Mapping[str, object] = field(default_factory=dict)
    assignment: Mapping[str, str] = field(default_factory=dict)
    room: RoomTransform = field(default_factory=RoomTransform)
    gate: GateSettings | None = field(default_factory=GateSettings)
    smoothing: OneEuroSettings | None = None

    def make_protocol(self) -> DeviceProtocol:
        """A fresh protocol that reads this device's bytes."""
        return make_protocol(self.protocol, **self.options)

    def intake(self) -> DeviceIntake:
        """A fresh intake as the session had it."""
        return DeviceIntake(self.assignment, self.room, self.gate, self.smoothing)

    def to_metadata(self) -> dict[str, str]:
        """As MCAP channel metadata: text values, structured ones as JSON."""
        room = {"rotation_xyzw": self.room.rotation, "translation_m": self.room.translation}
        return {
            "device": self.name,
            "protocol": self.protocol,
            "options": json.dumps(self.options),
            "assignment": json.dumps(self.assignment),
            "room": json.dumps(room),
            "gate": json.dumps(self.gate and asdict(self.gate)),
            "smoothing": json.dumps(self.smoothing and asdict(self.smoothing)),
        }

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> "RecordedDevice":
        """Raises KeyError, TypeError or ValueError where it is not what `to_metadata` wrote."""
        room, gate, smoothing = (json.loads(metadata[name]) for name in ("room", "gate", "smoothing"))
        rotation: Quaternion = tuple(map(float, room["rotation_xyzw"]))  # type: ignore[assignment]
        translation: Vector = tuple(map(float, room["translation_m"]))  # type: ignore[assignment]
        return cls(
            metadata["device"],
            metadata["protocol"],
            json.loads(metadata["options"]),
            json.loads(metadata["assignment"]),
            RoomTransform(rotation, translation),
            gate and GateSettings(**gate),
            smoothing and OneEuroSettings(**smoothing),
        )


@dataclass(frozen=True, slots=True)
class Mark:
    """A moment that somebody noted while recording. time_ns: host time."""

    time_ns: int
    text: str


@dataclass(frozen=True, slots=True)
class SettingsChange:
    """Settings that were changed while recording.

    time_ns: host time. values: by name as in `session.toml`, such as `device.suit.beta`. chunks_before: how many of
    each device's chunks stand before it in the take: it holds for those after.
    """

    time_ns: int
    values: Mapping[str, float | bool]
    chunks_before: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Take:
    """A take in memory.

    chunks: by device name, in time order; an empty chunk marks where a device was opened, the first time or again.
    metadata: the `sixpoint` record: version, created, session, calibration, ... as text.
    missing: what of the take could not be read, in words, or None where it is whole.
    marks, changes (of settings): in the order they were made.
    """

    path: Path
    devices: tuple[RecordedDevice, ...]
    chunks: Mapping[str, tuple[RawChunk, ...]]
    metadata: Mapping[str, str]
    missing: str | None = None
    marks: tuple[Mark, ...] = ()
    changes: tuple[SettingsChange, ...] = ()

    def samples(self, device: RecordedDevice) -> Iterator[TrackerSample]:
        """One device's samples, as its driver gave them live."""
        for _, samples in decoded(device.make_protocol(), self.chunks[device.name]):
            yield from samples

    def readings(self) -> list[RoleReading]:
        """The readings of all roles of all devices in the world, in the order of host time."""
        found = [reading for device in self.devices for reading in self._readings(device)]
        return sorted(found, key=lambda reading: reading.host_time_ns)

    def _readings(self, device: RecordedDevice) -> Iterator[RoleReading]:
        """One device's, with its gate and smoothing changed where they were changed live."""
        intake, changes = device.intake(), self._changes_of(device)
        for number, (_, samples) in enumerate(decoded(device.make_protocol(), self.chunks[device.name])):
            while changes and changes[0][0] <= number:
                _, key, value = changes.popleft()
                write_setting(intake, key, value)
            yield from intake.readings(samples)

    def _changes_of(self, device: RecordedDevice) -> deque[tuple[int, str, float | bool]]:
        """(number of the first chunk for which it holds, key, value) in the order they were made."""
        start = f"device.{device.name}."
        return deque(
            (change.chunks_before.get(device.name, 0), name.removeprefix(start), value)
            for change in self.changes
            for name, value in change.values.items()
            if name.startswith(start)
        )

    @property
    def duration_s(self) -> float:
        """Seconds from the first chunk to the last."""
        times = [chunk.host_time_ns for chunks in self.chunks.values() for chunk in chunks]
        return (max(times) - min(times)) * 1e-9 if times else 0.0


def decoded(
    protocol: DeviceProtocol, chunks: Iterator[RawChunk] | tuple[RawChunk, ...]
) -> Iterator[tuple[RawChunk, list[TrackerSample]]]:
    """Each chunk with the samples it completed; an empty chunk starts the stream anew."""
    for chunk in chunks:
        if not chunk.data:
            protocol.reset()
        yield chunk, protocol.feed(chunk.data, chunk.host_time_ns) if chunk.data else []


def read_take(path: Path | str) -> Take:
    """Reads a take; one that was cut off or damaged is read up to its last whole chunk, and `missing` says so.

    Raises FileError where there is no such file, it is no take, or nothing of it can be read.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise FileError(f"{path}: not a take: takes are MCAP files")
            records, assembly = _Records(file, path.stat().st_size), _Assembly(path)
            for record in records:
                assembly.add(record)
            return assembly.take(records.broken_at)
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None


class _Records:
    """The records of an MCAP file one after the other, up to its end or its first damage."""

    def __init__(self, file: IO[bytes], size: int) -> None:
        self._file, self._size = file, size
        self.broken_at: int | None = None
        """Byte at which the first record that is not whole begins."""

    def __iter__(self) -> Iterator[McapRecord]:
        at, crc = len(MCAP0_MAGIC), zlib.crc32(MCAP0_MAGIC)
        while True:
            head = self._file.read(_RECORD_HEAD.size)
            opcode, length = _RECORD_HEAD.unpack(head) if len(head) == _RECORD_HEAD.size else (0, self._size)
            end = at + _RECORD_HEAD.size + length
            self.broken_at = at
            if end > self._size:
                return
            body = self._file.read(length)
            try:
                if opcode == Opcode.FOOTER:
                    self.broken_at = None if self._file.read() == MCAP0_MAGIC else end
                    return
                if opcode == Opcode.DATA_END and DataEnd.read(_stream(body)).data_section_crc not in (0, crc):
                    return
                yield from _content(opcode, body)
            except (McapError, ValueError, struct.error, zlib.error, zstandard.ZstdError, MemoryError):
                return
            crc = zlib.crc32(body, zlib.crc32(head, crc))
            at = end


def _content(opcode: int, body: bytes) -> list[McapRecord]:
    """What of a record matters here: the records inside a chunk whose checksum holds, and metadata.

    Raises ValueError for a kind of record that MCAP does not have: a chunk whose first byte is damaged.
    """
    if opcode < _FIRST_PRIVATE_OPCODE:
        Opcode(opcode)
    if opcode == Opcode.CHUNK:
        return breakup_chunk(Chunk.read(_stream(body)), validate_crc=True)
    return [Metadata.read(_stream(body))] if opcode == Opcode.METADATA else []


def _stream(body: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(body))


class _Assembly:
    """A take in the making, record by record in the order of the file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._devices: dict[int, RecordedDevice] = {}
        self._topics: dict[int, str] = {}
        self._chunks: dict[str, list[RawChunk]] = {}
        self._metadata: dict[str, str] = {}
        self._marks: list[Mark] = []
        self._changes: list[SettingsChange] = []

    def add(self, record: McapRecord) -> None:
        """Raises FileError for a device or a change of settings that is not as we write it."""
        if isinstance(record, Message):
            self._add_message(record)
        elif isinstance(record, Channel):
            self._add_channel(record)
        elif isinstance(record, Metadata) and record.name == METADATA_NAME:
            self._metadata.update(record.metadata)

    def _add_channel(self, channel: Channel) -> None:
        self._topics[channel.id] = channel.topic
        if channel.message_encoding == RAW_ENCODING and channel.id not in self._devices:
            device = self._devices[channel.id] = _device(self._path, channel)
            self._chunks.setdefault(device.name, [])

    def _add_message(self, message: Message) -> None:
        device, topic = self._devices.get(message.channel_id), self._topics.get(message.channel_id)
        if device is not None:
            self._chunks[device.name].append(RawChunk(message.log_time, bytes(message.data)))
        elif topic == MARKS_TOPIC:
            self._marks.append(_mark(message))
        elif topic == SETTINGS_TOPIC:
            before = {name: len(found) for name, found in self._chunks.items()}
            self._changes.append(SettingsChange(message.log_time, _values(self._path, message), before))

    def take(self, broken_at: int | None) -> Take:
        """What has come. broken_at: the byte from which on nothing could be read, None for a whole take."""
        path, devices = self._path, tuple(self._devices.values())
        if not any(self._chunks.values()):
            broken = f"; it is cut off at byte {broken_at}, before its first data" if broken_at else ""
            raise FileError(f"{path}: no device's bytes in it{broken}")
        chunks = {name: tuple(found) for name, found in self._chunks.items()}
        take = Take(path, devices, chunks, self._metadata, None, tuple(self._marks), tuple(self._changes))
        if broken_at is None:
            return take
        missing = (
            f"{path}: cut off or damaged at byte {broken_at}: read up to the last whole chunk before it, "
            f"{take.duration_s:.2f} s; what may have come after is missing"
        )
        return replace(take, missing=missing)


def _mark(message: Message) -> Mark:
    """A mark; one that is not as we write it is kept with what text there is."""
    try:
        text = str(json.loads(message.data)["message"])
    except (ValueError, KeyError, TypeError):
        text = message.data.decode(errors="replace")
    return Mark(message.log_time, text)


def _values(path: Path, message: Message) -> dict[str, float | bool]:
    """Changed settings. Raises FileError where they are not as we write them: what was done would not be known."""
    try:
        values = json.loads(message.data)
        return {str(name): value if isinstance(value, bool) else float(value) for name, value in values.items()}
    except (ValueError, AttributeError, TypeError):
        raise FileError(f"{path}: a message on {SETTINGS_TOPIC} is not as sixpoint writes it") from None


def _device(path: Path, channel: Channel) -> RecordedDevice:
    try:
        return RecordedDevice.from_metadata(channel.metadata)
    except (KeyError, ValueError, TypeError, SettingError):
        raise FileError(f"{path}: channel {channel.topic} does not describe its device as sixpoint does") from None
