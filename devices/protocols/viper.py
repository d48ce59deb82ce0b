"""Polhemus VIPER on RS-422: checked frames whose units travel with every sensor.

Sources: the vendor's headers in the public ROS drivers `VPif3.h`, `viper_protocol.h`. Over USB it is a vendor bulk
device, which neither a serial port nor HID reaches.

A frame is a preamble (`VPRP` pose, `VPRC` command), the number of bytes that follow, the body, and a CRC-16/ARC of all
before it in a 32-bit word; everything is little-endian.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import degrees
from typing import ClassVar

from devices.axes import Quaternion
from devices.errors import DeviceError
from devices.protocols._conversation import Question, find_baud
from devices.protocols._crc import crc16
from devices.protocols._framing import DROP_ONE, WAIT, FramedProtocol, Scan, drop_until
from devices.protocols._poses import (
    FORWARD_RIGHT_DOWN,
    IDENTITY,
    INCH_M,
    euler_from_quaternion,
    plausible_position,
    quaternion_from_euler,
    unit_quaternion,
)
from devices.protocols.counters import SequenceGaps
from devices.protocols.protocol import Drain, Receive, Script, SimulatedDevice, Write
from devices.sample import SampleFlag, TrackerSample

POSE, COMMAND = b"VPRP", b"VPRC"
UNIT_M = (INCH_M, 0.3048, 0.01, 1.0)
"""Metres of the position units 0 inch, 1 foot, 2 centimetre, 3 metre."""
DEGREES, RADIANS, QUATERNION = 0, 1, 2
METRE = 3

SET, GET, RESET, ACKNOWLEDGED, REFUSED = range(5)
UNITS, STATION_MAP, SINGLE_POSE, CONTINUOUS = 7, 10, 18, 19

_PREFIX = struct.Struct("<4sI")
_POSE_HEAD = struct.Struct("<4sIIIII")
_SENSOR = struct.Struct("<I3f4f")
_COMMAND_BODY = struct.Struct("<iIIII")
_CRC_SIZE = 4
_MOST_SENSORS = 16
_LARGEST_COMMAND = 256
_BAUDS = (921600, 460800, 230400, 115200)


def frame(preamble: bytes, body: bytes) -> bytes:
    """A whole frame around a body."""
    checked = _PREFIX.pack(preamble, len(body) + _CRC_SIZE) + body
    return checked + struct.pack("<I", crc16(checked))


def command_frame(command: int, action: int, payload: bytes = b"", arg1: int = 0, arg2: int = 0) -> bytes:
    """A command to, or a reply of, any unit."""
    return frame(COMMAND, _COMMAND_BODY.pack(-1, command, action, arg1, arg2) + payload)


@dataclass
class Viper(FramedProtocol):
    """A VIPER with up to 16 sensors. The frame rate is what the device has stored."""

    name: ClassVar[str] = "viper"
    title: ClassVar[str] = "Polhemus VIPER (RS-422)"
    rate_hz: ClassVar[float] = 240.0
    max_trackers: ClassVar[int] = _MOST_SENSORS
    filters_itself: ClassVar[bool] = True

    _gaps: SequenceGaps = field(default_factory=lambda: SequenceGaps(1 << 32), init=False, repr=False, compare=False)

    def reset(self) -> None:
        super().reset()
        self._gaps = SequenceGaps(1 << 32)

    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        here = buffer[start : start + 4]
        if here not in (POSE, COMMAND):
            return WAIT if POSE.startswith(here) or COMMAND.startswith(here) else drop_until(buffer, start, b"VPR")
        size = self._frame_size(buffer, start)
        if size is None:
            return DROP_ONE
        if not size or len(buffer) - start < size:
            return WAIT
        checked = buffer[start : start + size - _CRC_SIZE]
        if crc16(checked) != int.from_bytes(buffer[start + len(checked) : start + size], "little"):
            self.counters.bad_frames += 1
            return DROP_ONE
        return size, self._samples(checked, host_time_ns) if here == POSE else []

    def _frame_size(self, buffer: bytes, start: int) -> int | None:
        """Bytes of the frame at `start`; 0 where more are needed to tell, None where the size cannot be."""
        ready = len(buffer) - start
        if buffer.startswith(COMMAND, start):
            if ready < _PREFIX.size:
                return 0
            size = _PREFIX.size + _PREFIX.unpack_from(buffer, start)[1]
            return size if size <= _LARGEST_COMMAND else None
        if ready < _POSE_HEAD.size:
            return 0
        _, following, _, _, _, sensors = _POSE_HEAD.unpack_from(buffer, start)
        size = _POSE_HEAD.size + _SENSOR.size * sensors + _CRC_SIZE
        return size if sensors <= _MOST_SENSORS and following == size - _PREFIX.size else None

    def _samples(self, checked: bytes, host_time_ns: int) -> list[TrackerSample]:
        _, _, _, number, info, sensors = _POSE_HEAD.unpack_from(checked)
        self.counters.missed += self._gaps(number) * sensors
        broken = bool(info >> 4 & 0xF)
        return [
            _sample(values, number, broken, host_time_ns) for values in _SENSOR.iter_unpack(checked[_POSE_HEAD.size :])
        ]

    def start(self) -> Script:
        hint = "check its power, and that it is the RS-422 port (its USB port is no serial port)"
        yield from find_baud(self, _BAUDS, self._has_sensors, hint)
        for what, request in (
            ("metres and quaternions", command_frame(UNITS, SET, struct.pack("<II", METRE, QUATERNION))),
            ("continuous output", command_frame(CONTINUOUS, SET)),
        ):
            yield Write(request)
            reply = yield Receive(0.5, size=len(command_frame(0, 0)))
            if _action(reply) == REFUSED:
                raise DeviceError(f"{self.title} refuses {what}: update its firmware, or reset it to its defaults")

    def stop(self) -> Script:
        yield Write(command_frame(CONTINUOUS, RESET))
        yield Drain()

    def _has_sensors(self) -> Question:
        """Stops a stream left on, and asks which sensors there are."""
        yield Write(command_frame(CONTINUOUS, RESET))
        yield Drain()
        yield Write(command_frame(STATION_MAP, GET))
        reply = yield Receive(0.5, size=len(command_frame(0, 0, bytes(4))))
        if _action(reply) != ACKNOWLEDGED:
            return False
        payload = reply[_PREFIX.size + _COMMAND_BODY.size :][:2]
        if not any(payload):
            raise DeviceError(f"{self.title} has no sensor: plug one in")
        return True

    def simulator(self, roles: Sequence[str]) -> "SimulatedViper":
        return SimulatedViper(len(roles))


def _action(reply: bytes) -> int | None:
    """What a reply says: `ACKNOWLEDGED`, `REFUSED`; None where it is no reply."""
    if not reply.startswith(COMMAND) or len(reply) < _PREFIX.size + _COMMAND_BODY.size:
        return None
    return _COMMAND_BODY.unpack_from(reply, _PREFIX.size)[2]


def _sample(values: tuple, number: int, broken: bool, host_time_ns: int) -> TrackerSample:
    """One sensor's 32 bytes: information word, position, turn."""
    info, x, y, z, *turn = values
    tracker = f"{'virtual ' if info & 0x80 else ''}{(info & 0x7F) + 1}"
    unit = UNIT_M[info >> 8 & 3]
    axes = FORWARD_RIGHT_DOWN
    position = axes.to_rub((x * unit, y * unit, z * unit))
    orientation = _turn(turn, info >> 10 & 3)
    if not plausible_position(position):
        return TrackerSample(tracker, host_time_ns, sequence=number, flags=SampleFlag.SUSPECT)
    flags = SampleFlag.BUTTON if info >> 12 & 3 else SampleFlag.NONE
    return TrackerSample(
        tracker,
        host_time_ns,
        position,
        orientation and axes.quaternion_to_rub(orientation),
        sequence=number,
        quality=1 - (info >> 14 & 0xFF) / 255,
        flags=flags | (SampleFlag.SUSPECT if broken else SampleFlag.NONE),
    )


def _turn(numbers: Sequence[float], kind: int) -> Quaternion | None:
    """(x, y, z, w) of the four numbers of a sensor; None where they are no turn."""
    if kind == QUATERNION:
        w, x, y, z = numbers
        return unit_quaternion((x, y, z, w))
    if kind > QUATERNION or not all(-360 <= angle <= 360 for angle in numbers[:3]):
        return None
    azimuth, elevation, roll = numbers[:3] if kind == DEGREES else map(degrees, numbers[:3])
    return quaternion_from_euler((azimuth, elevation, roll))


class SimulatedViper(SimulatedDevice):
    """A VIPER as it is switched on: centimetres, Euler angles in degrees, silent."""

    def __init__(self, trackers: int) -> None:
        self._trackers = trackers
        self._pending = b""
        self._number = 0
        self.streaming = False
        self.unit, self.turn_kind = 2, DEGREES

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._number = (self._number + 1) % (1 << 32)
        return [self._pose(samples)] if self.streaming else []

    def answer(self, data: bytes) -> bytes:
        self._pending += data
        replies = b""
        while len(self._pending) >= _PREFIX.size:
            if not self._pending.startswith(COMMAND):
                self._pending = self._pending[1:]
                continue
            size = _PREFIX.size + _PREFIX.unpack_from(self._pending)[1]
            if len(self._pending) < size:
                break
            request, self._pending = self._pending[:size], self._pending[size:]
            replies += self._answer(request)
        return replies

    def _answer(self, request: bytes) -> bytes:
        _, command, action, arg1, arg2 = _COMMAND_BODY.unpack_from(request, _PREFIX.size)
        payload = request[_PREFIX.size + _COMMAND_BODY.size : -_CRC_SIZE]
        reply = b""
        match command, action:
            case (7, 0):
                self.unit, self.turn_kind = struct.unpack("<II", payload)
            case (10, 1):
                reply = struct.pack("<I", (1 << self._trackers) - 1 | 1 << 24)
            case (19, 0 | 2):
                self.streaming = action == SET
            case _:
                return command_frame(command, REFUSED, b"", arg1, arg2)
        return command_frame(command, ACKNOWLEDGED, reply, arg1, arg2)

    def _pose(self, samples: Sequence[TrackerSample]) -> bytes:
        seen = [(n, s) for n, s in enumerate(samples) if s.position is not None]
        head = struct.pack("<IIII", 1, self._number, 0, len(seen))
        return frame(POSE, head + b"".join(self._sensor(n, sample) for n, sample in seen))

    def _sensor(self, number: int, sample: TrackerSample) -> bytes:
        axes = FORWARD_RIGHT_DOWN
        x, y, z = (value / UNIT_M[self.unit] for value in axes.from_rub(sample.position or (0.0, 0.0, 0.0)))
        turn = axes.quaternion_from_rub(sample.orientation or IDENTITY)
        numbers = (turn[3], *turn[:3]) if self.turn_kind == QUATERNION else (*euler_from_quaternion(turn), 0.0)
        return _SENSOR.pack(number | self.unit << 8 | self.turn_kind << 10, x, y, z, *numbers)
