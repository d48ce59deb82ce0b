"""Marvelmind ultrasonic beacons: what a mobile beacon or the modem streams by itself.

Sources: the vendor's marvelmind.py; the vendor's description of the streaming packets (for flag bit 0).

A packet is `FF 47`, its type, the payload's length, the payload, and a CRC-16/MODBUS of all before it.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from devices.axes import Axes
from devices.protocols._conversation import Question, find_baud
from devices.protocols._crc import crc16
from devices.protocols._framing import DROP_ONE, WAIT, FramedProtocol, Scan, drop_until
from devices.protocols._poses import plausible_position, unit_quaternion
from devices.protocols.counters import Unwrapped
from devices.protocols.protocol import Receive, Script, SerialFormat, SimulatedDevice
from devices.sample import SampleFlag, TrackerSample

AXES = Axes("RFU")
"""The beacons' map: z up."""

MARK = b"\xff\x47"
POSITION_CM, FUSION, POSITION_MM = 0x0001, 0x0005, 0x0011
_PAYLOADS = {
    POSITION_CM: struct.Struct("<IhhhBBH2x"),
    FUSION: struct.Struct("<iii4h3h3h2xI4x"),
    POSITION_MM: struct.Struct("<IiiiBBH2x"),
}
_OTHER_KINDS = (0x0003, 0x0004, 0x0006, 0x0007, *range(0x0080, 0x0090))
"""Raw inertial values, distances, telemetry, quality, and variants with a 64-bit clock: passed over."""

_HEAD = struct.Struct("<2sHB")
_CRC_SIZE = 2
_MODBUS = 0xFFFF
_UNAVAILABLE = 0x01
_BAUDS = (500000, 115200, 19200, 38400, 57600)


def packet(kind: int, payload: bytes) -> bytes:
    """A whole packet around a payload."""
    checked = _HEAD.pack(MARK, kind, len(payload)) + payload
    return checked + crc16(checked, _MODBUS).to_bytes(_CRC_SIZE, "little")


@dataclass
class Marvelmind(FramedProtocol):
    """Beacons by their addresses. One with inertial fusion sends its turn too, but no address: tracker "fusion"."""

    name: ClassVar[str] = "marvelmind"
    title: ClassVar[str] = "Marvelmind beacons"
    serial: ClassVar[SerialFormat] = SerialFormat(baud=9600)
    rate_hz: ClassVar[float] = 16.0
    max_trackers: ClassVar[int] = 16
    filters_itself: ClassVar[bool] = True

    _clock: Unwrapped = field(default_factory=lambda: Unwrapped(1 << 32), init=False, repr=False, compare=False)

    def reset(self) -> None:
        super().reset()
        self._clock = Unwrapped(1 << 32)

    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        if not buffer.startswith(MARK, start):
            half = len(buffer) - start == 1 and buffer.endswith(MARK[:1])
            return WAIT if half else drop_until(buffer, start, MARK)
        if len(buffer) - start < _HEAD.size:
            return WAIT
        _, kind, length = _HEAD.unpack_from(buffer, start)
        known = _PAYLOADS.get(kind)
        if known.size != length if known else kind not in _OTHER_KINDS:
            return DROP_ONE
        size = _HEAD.size + length + _CRC_SIZE
        if len(buffer) - start < size:
            return WAIT
        if crc16(buffer[start : start + size], _MODBUS):
            self.counters.bad_frames += 1
            return DROP_ONE
        if not known:
            return size, []
        values = known.unpack_from(buffer, start + _HEAD.size)
        return size, [
            self._fused(values, host_time_ns) if kind == FUSION else self._located(kind, values, host_time_ns)
        ]

    def _located(self, kind: int, values: tuple, host_time_ns: int) -> TrackerSample:
        time_ms, x, y, z, flags, address, _ = values
        unit = 0.01 if kind == POSITION_CM else 0.001
        position = (x * unit, y * unit, z * unit)
        seen = not flags & _UNAVAILABLE and plausible_position(position)
        return TrackerSample(
            tracker=str(address),
            host_time_ns=host_time_ns,
            position=AXES.to_rub(position) if seen else None,
            device_time_s=self._clock(time_ms) / 1000,
            flags=SampleFlag.NONE if seen else SampleFlag.SUSPECT,
        )

    def _fused(self, values: tuple, host_time_ns: int) -> TrackerSample:
        x, y, z, qw, qx, qy, qz = values[:7]
        position = (x / 1000, y / 1000, z / 1000)
        turn = unit_quaternion((qx / 10000, qy / 10000, qz / 10000, qw / 10000))
        return TrackerSample(
            tracker="fusion",
            host_time_ns=host_time_ns,
            position=AXES.to_rub(position) if plausible_position(position) else None,
            orientation=turn and AXES.quaternion_to_rub(turn),
            device_time_s=self._clock(values[-1]) / 1000,
        )

    def start(self) -> Script:
        """Nothing to say: only the line's speed is found, by listening."""
        hint = 'switch "streaming" on in the Dashboard, and check that the beacon is in its map and awake'
        yield from find_baud(self, _BAUDS, self._streams, hint)

    def _streams(self) -> Question:
        """Whether a good packet comes; on USB the speed does not matter, so that the first one will do."""
        heard = yield Receive(0.6, size=300)
        self.reset()
        good = bool(self.feed(heard, 0))
        self.reset()
        return good

    def simulator(self, roles: Sequence[str]) -> "SimulatedMarvelmind":
        return SimulatedMarvelmind()


class SimulatedMarvelmind(SimulatedDevice):
    """A modem that streams the positions of beacons 1, 2, ... in millimetres, whoever listens."""

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        return [self._packet(address, sample) for address, sample in enumerate(samples, start=1)]

    def _packet(self, address: int, sample: TrackerSample) -> bytes:
        x, y, z = (round(1000 * value) for value in AXES.from_rub(sample.position or (0.0, 0.0, 0.0)))
        time_ms = round(1000 * (sample.device_time_s or 0.0)) % (1 << 32)
        flags = 0 if sample.position else _UNAVAILABLE
        return packet(POSITION_MM, _PAYLOADS[POSITION_MM].pack(time_ms, x, y, z, flags, address, 0))
