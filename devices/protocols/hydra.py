"""Razer Hydra over USB HID: a magnetic base with two wired wands.

Sources: the public protocol notes razer-hydra-hid-protocol with their log of real reports; the VRPN and ROS drivers.

The base wakes up as a gamepad and is switched to motion reports by a feature report. A motion report has 52 bytes; its
trailer is a CRC-16 (polynomial 0x1021, start 0x1D0F), found in the public log and true of all 4775 reports there.
"""

import binascii
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from devices.axes import Axes, Vector
from devices.errors import DeviceError
from devices.protocols._poses import IDENTITY, unit_quaternion
from devices.protocols.counters import SequenceGaps
from devices.protocols.protocol import (
    DeviceProtocol,
    HidMatch,
    Receive,
    Script,
    SendFeature,
    SimulatedDevice,
)
from devices.sample import SampleFlag, TrackerSample

AXES = Axes("RBD")
"""The base's frame: x to the user's right, y towards the user, z down."""

REPORT_SIZE = 52
_HEAD = bytes.fromhex("010034000200")
_WAND = struct.Struct("<BB3h4hB2hB")
_CRC_START = 0x1D0F
_ALWAYS_SET = 0x80
_GAMEPAD_REPORT = bytes(12)
_FEATURE_SIZE = 91


def mode_report(motion: bool) -> bytes:
    """The feature report, with its ID 0, that switches to motion reports or back to the gamepad.

    Its last byte but one is the XOR of the payload.
    """
    report = bytearray(_FEATURE_SIZE)
    report[6], report[8], report[9] = 1, 4, 3 if motion else 0
    report[89] = report[6] ^ report[8] ^ report[9]
    return bytes(report)


@dataclass
class Hydra(DeviceProtocol):
    """Wands "1" (left) and "2" (right).

    The base cannot tell a place from its opposite through the base's centre. Each report's choice is the one nearer to
    the last; the first is taken as it comes, above the base: start with the wands above it, near their docks.
    require_checksum: whether a report with a wrong CRC is left out; the CRC is known from one unit's log only.
    """

    name: ClassVar[str] = "hydra"
    title: ClassVar[str] = "Razer Hydra"
    link: ClassVar[Literal["serial", "hid"]] = "hid"
    hid: ClassVar[tuple[HidMatch, ...]] = (HidMatch(0x1532, 0x0300, interface=0, report_size=REPORT_SIZE),)
    report_descriptor: ClassVar[bytes] = bytes.fromhex("05010900a1010903150026ff00350046ff00750895348102c0")
    rate_hz: ClassVar[float] = 250.0
    max_trackers: ClassVar[int] = 2
    checked: ClassVar[str] = "one report of a real unit, documents and simulator"

    require_checksum: bool = True
    _last: dict[int, Vector] = field(default_factory=dict, init=False, repr=False, compare=False)
    _gaps: SequenceGaps = field(default_factory=lambda: SequenceGaps(256), init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self.role_hints.update({"1": "left_wrist", "2": "right_wrist"})

    def reset(self) -> None:
        super().reset()
        self._last = {}
        self._gaps = SequenceGaps(256)

    def feed(self, data: bytes, host_time_ns: int) -> list[TrackerSample]:
        if len(data) != REPORT_SIZE or not data.startswith(_HEAD):
            self.counters.bytes_dropped += len(data)
            return []
        if binascii.crc_hqx(data[:50], _CRC_START) != int.from_bytes(data[50:], "little"):
            self.counters.bad_frames += 1
            if self.require_checksum:
                return []
        self.counters.missed += 2 * self._gaps(data[7])
        return [self._wand(_WAND.unpack_from(data, at), host_time_ns) for at in (6, 6 + _WAND.size)]

    def _wand(self, values: tuple, host_time_ns: int) -> TrackerSample:
        index, sequence, x, y, z, qw, qx, qy, qz, buttons, _, _, trigger = values
        tracker = str(index)
        turn = unit_quaternion((qx / 32768, qy / 32768, qz / 32768, qw / 32768))
        if turn is None:
            return TrackerSample(tracker, host_time_ns, sequence=sequence, flags=SampleFlag.SUSPECT)
        return TrackerSample(
            tracker,
            host_time_ns,
            AXES.to_rub(self._continuous(index, (x / 1000, y / 1000, z / 1000))),
            AXES.quaternion_to_rub(turn),
            sequence=sequence,
            flags=SampleFlag.BUTTON if buttons & ~_ALWAYS_SET or trigger else SampleFlag.NONE,
        )

    def _continuous(self, index: int, raw: Vector) -> Vector:
        """The position or its opposite, whichever is nearer to the wand's last one."""
        last = self._last.get(index, raw)
        ahead = sum(a * b for a, b in zip(raw, last, strict=True)) >= 0
        position = raw if ahead else (-raw[0], -raw[1], -raw[2])
        self._last[index] = position
        return position

    def start(self) -> Script:
        if _HEAD in (yield Receive(1.0, until=_HEAD)):
            return
        for _ in range(10):
            yield SendFeature(mode_report(motion=True))
            if _HEAD in (yield Receive(0.5, until=_HEAD)):
                return
        raise DeviceError(f"{self.title} stays a gamepad: unplug it, plug it in again, and start with the wands docked")

    def stop(self) -> Script:
        yield SendFeature(mode_report(motion=False))

    def simulator(self, roles: Sequence[str]) -> "SimulatedHydra":
        return SimulatedHydra()


class SimulatedHydra(SimulatedDevice):
    """A base that is a gamepad until told otherwise, and that folds what is below it through its centre."""

    def __init__(self) -> None:
        self.streaming = False
        self._sequence = 0

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        if not self.streaming:
            return [_GAMEPAD_REPORT]
        self._sequence = (self._sequence + 1) % 256
        wands = [sample for sample in samples[:2]] + [None] * (2 - len(samples))
        report = _HEAD + b"".join(self._wand(index, wand) for index, wand in enumerate(wands, start=1))
        return [report + binascii.crc_hqx(report, _CRC_START).to_bytes(2, "little")]

    def set_feature(self, report: bytes) -> None:
        self.streaming = report == mode_report(motion=True) or (self.streaming and report != mode_report(motion=False))

    def _wand(self, index: int, sample: TrackerSample | None) -> bytes:
        """One wand's 22 bytes; one that is not there has zeros for its place and turn."""
        if sample is None or sample.position is None:
            return _WAND.pack(index, self._sequence, *(0,) * 7, _ALWAYS_SET, 0, 0, 0)
        x, y, z = (round(1000 * value) for value in AXES.from_rub(sample.position))
        if z > 0:
            x, y, z = -x, -y, -z
        turn = AXES.quaternion_from_rub(sample.orientation or IDENTITY)
        qw, qx, qy, qz = (max(-32768, min(32767, round(32768 * value))) for value in (turn[3], *turn[:3]))
        buttons = _ALWAYS_SET | (0x01 if sample.flags & SampleFlag.BUTTON else 0)
        return _WAND.pack(index, self._sequence, x, y, z, qw, qx, qy, qz, buttons, 0, 0, 0)
