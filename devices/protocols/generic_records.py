"""The generic binary records, the same bytes on a serial line (COBS framed) and in HID reports. Little-endian.

Sample, 32 bytes: u8 type 1, u8 tracker, u8 flags, u8 quality, u8 battery, u8 buttons, u16 sequence, u32 device time in
microseconds, 3 f32 position in metres, 4 i16 quaternion w x y z times 32767. Info, 52 bytes: u8 type 2, u8 version 1,
u8 tracker count, u8 capabilities, u16 rate, u16 0, char[4] axes, char[24] name, char[16] serial number.
Command: u8 type 3, u8 what, u16 rate.
"""

import struct
from dataclasses import dataclass, field

from devices.axes import Axes
from devices.errors import SettingError
from devices.protocols.counters import SequenceGaps, Unwrapped
from devices.protocols.protocol import StreamCounters
from devices.sample import SampleFlag, TrackerSample

SAMPLE = struct.Struct("<6BHI3f4h")
INFO = struct.Struct("<4BHH4s24s16s")
COMMAND = struct.Struct("<BBH")
SAMPLE_TYPE, INFO_TYPE, COMMAND_TYPE = 1, 2, 3
STOP, START, QUERY = 0, 1, 2
FARTHEST_M = 50.0
_POSITION_VALID, _ROTATION_VALID = 1, 2
_FLAGS = {4: SampleFlag.HELD, 8: SampleFlag.ESTIMATED, 16: SampleFlag.CHARGING}
_UNKNOWN = 255
_UNIT = 32767

_FLAG_TABLE = tuple(sum((flag for bit, flag in _FLAGS.items() if bits & bit), SampleFlag.NONE) for bits in range(256))


@dataclass(slots=True)
class RecordReader:
    """Turns checked records into samples, with the clock and running numbers of one stream."""

    axes: Axes
    counters: StreamCounters
    _clock: Unwrapped = field(default_factory=lambda: Unwrapped(1 << 32))
    _gaps: dict[int, SequenceGaps] = field(default_factory=dict)

    def sample(self, record: bytes, host_time_ns: int) -> TrackerSample | None:
        """The sample of a record of type 1, or None, counted as a bad frame, where its numbers make no sense."""
        _, tracker, bits, quality, battery, buttons, sequence, t_us, x, y, z, w, i, j, k = SAMPLE.unpack(record)
        position = orientation = None
        if bits & _POSITION_VALID:
            # Written so that NaN fails too.
            if not (abs(x) < FARTHEST_M and abs(y) < FARTHEST_M and abs(z) < FARTHEST_M):
                self.counters.bad_frames += 1
                return None
            position = self.axes.to_rub((x, y, z))
        length = (w * w + i * i + j * j + k * k) ** 0.5
        if bits & _ROTATION_VALID and length:
            if not 0.9 * _UNIT < length < 1.1 * _UNIT:
                self.counters.bad_frames += 1
                return None
            orientation = self.axes.quaternion_to_rub((i / length, j / length, k / length, w / length))
        gaps = self._gaps.get(tracker)
        if gaps is None:
            gaps = self._gaps[tracker] = SequenceGaps(1 << 16)
        self.counters.missed += gaps(sequence)
        flags = _FLAG_TABLE[bits]
        if buttons:
            flags |= SampleFlag.BUTTON
        return TrackerSample(
            str(tracker), host_time_ns, position, orientation, self._clock(t_us) * 1e-6, sequence,
            _share(quality), _share(battery), flags,
        )  # fmt: skip


def _share(value: int) -> float | None:
    return None if value == _UNKNOWN else min(value, 100) / 100


def encode_sample(sample: TrackerSample, sequence: int, axes: Axes) -> bytes:
    """The record of a sample whose tracker is a number."""
    bits = sum(bit for bit, flag in _FLAGS.items() if sample.flags & flag)
    position, wxyz = (0.0, 0.0, 0.0), (0, 0, 0, 0)
    if sample.position is not None:
        bits |= _POSITION_VALID
        position = axes.from_rub(sample.position)
    if sample.orientation is not None:
        bits |= _ROTATION_VALID
        x, y, z, w = axes.quaternion_from_rub(sample.orientation)
        wxyz = tuple(round(_UNIT * value) for value in (w, x, y, z))
    return SAMPLE.pack(
        SAMPLE_TYPE, int(sample.tracker), bits, _byte(sample.quality), _byte(sample.battery),
        int(bool(sample.flags & SampleFlag.BUTTON)), sequence % (1 << 16),
        round((sample.device_time_s or 0.0) * 1e6) % (1 << 32), *position, *wxyz,
    )  # fmt: skip


def _byte(share: float | None) -> int:
    return _UNKNOWN if share is None else round(100 * share)


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """What a device says of itself. capabilities: 1 position, 2 rotation, 4 battery."""

    trackers: int
    rate_hz: int
    axes: str
    name: str
    serial_number: str
    capabilities: int = 7

    def encode(self) -> bytes:
        """The record of type 2."""
        return INFO.pack(
            INFO_TYPE, 1, self.trackers, self.capabilities, self.rate_hz, 0,
            self.axes.encode(), self.name.encode(), self.serial_number.encode(),
        )  # fmt: skip

    @classmethod
    def decode(cls, record: bytes) -> "DeviceInfo | None":
        """None where it is no info record of version 1 with right-handed axes."""
        if len(record) != INFO.size:
            return None
        kind, version, trackers, capabilities, rate_hz, _, axes, name, serial_number = INFO.unpack(record)
        info = cls(trackers, rate_hz, _text(axes), _text(name), _text(serial_number), capabilities)
        try:
            Axes(info.axes)
        except SettingError:
            return None
        return info if (kind, version) == (INFO_TYPE, 1) else None


def _text(field_bytes: bytes) -> str:
    return field_bytes.split(b"\0", 1)[0].decode("utf-8", "replace")
