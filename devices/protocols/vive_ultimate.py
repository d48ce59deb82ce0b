"""HTC VIVE Ultimate trackers through their dongle, over USB HID. Experimental, and read-only.

Sources: the public reverse engineering vive_ultimate_tracker_re; pyvut; ViveUltimateTrackerWithoutHmdUnity.

Trackers that were paired and mapped with the vendor's software send their poses unasked. Nothing is ever written to
the dongle: several of its commands change its firmware's state.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from devices.axes import Axes
from devices.errors import choice_error
from devices.protocols._poses import IDENTITY, plausible_position, unit_quaternion
from devices.protocols.protocol import DeviceProtocol, HidMatch, SimulatedDevice
from devices.sample import SampleFlag, TrackerSample

AXES = Axes("RUB")
"""Y up; where the map's x and z point was settled when it was made."""

REPORT_SIZE = 64
_TRACKER_DATA = 0x28
_POSE_TYPES = (0x0110, 0x1001)
_HEAD = struct.Struct("<BH6sHB")
_POSE = struct.Struct("<BB3f4e3e3eHB")
_LENGTHS = range(_POSE.size, REPORT_SIZE - _HEAD.size + 1)
TRACKED, ROTATION_ONLY, LOST = 2, 3, 4
_ORDERS = {"xyzw": (0, 1, 2, 3), "wxyz": (1, 2, 3, 0), "wzyx": (3, 2, 1, 0)}
"""Order on the wire -> where x, y, z, w are in it."""


@dataclass
class ViveUltimate(DeviceProtocol):
    """Up to five trackers. quaternion_order: "xyzw" as most readers of it have it; some say "wzyx"."""

    name: ClassVar[str] = "vive_ultimate"
    title: ClassVar[str] = "HTC VIVE Ultimate dongle (experimental)"
    link: ClassVar[Literal["serial", "hid"]] = "hid"
    hid: ClassVar[tuple[HidMatch, ...]] = (HidMatch(0x0BB4, 0x0350, interface=0, report_size=REPORT_SIZE),)
    # The real one is not known here: 64 bytes in, without an ID, on a vendor's page that no other protocol asks for.
    report_descriptor: ClassVar[bytes] = bytes.fromhex("0601ff0901a101150026ff007508954009028102c0")
    rate_hz: ClassVar[float] = 60.0
    max_trackers: ClassVar[int] = 5
    filters_itself: ClassVar[bool] = True
    checked: ClassVar[str] = "others' reverse engineering and simulator"

    quaternion_order: str = "xyzw"

    def __post_init__(self) -> None:
        if self.quaternion_order not in _ORDERS:
            raise choice_error("quaternion_order", self.quaternion_order, _ORDERS)

    def feed(self, data: bytes, host_time_ns: int) -> list[TrackerSample]:
        report = data[1:] if len(data) == REPORT_SIZE + 1 and data[0] == 0 else data
        if len(report) != REPORT_SIZE or report[0] != _TRACKER_DATA:
            self.counters.bytes_dropped += len(data)
            return []
        _, _, address, kind, length = _HEAD.unpack_from(report)
        if kind not in _POSE_TYPES or length not in _LENGTHS:
            return []
        sample = self._sample(str(address[1] & 0x0F), _POSE.unpack_from(report, _HEAD.size), host_time_ns)
        if sample is None:
            self.counters.bad_frames += 1
            return []
        return [sample]

    def _sample(self, tracker: str, values: tuple, host_time_ns: int) -> TrackerSample | None:
        """None where the numbers cannot be a pose."""
        counter, buttons, x, y, z = values[:5]
        turn = unit_quaternion(tuple(values[5 + i] for i in _ORDERS[self.quaternion_order]))  # type: ignore[arg-type]
        status = values[-1]
        if turn is None or not plausible_position((x, y, z)) or status not in (TRACKED, ROTATION_ONLY, LOST):
            return None
        flags = SampleFlag.BUTTON if buttons & 0x7F else SampleFlag.NONE
        if status == LOST:
            flags |= SampleFlag.HELD
        return TrackerSample(
            tracker,
            host_time_ns,
            None if status == ROTATION_ONLY else AXES.to_rub((x, y, z)),
            AXES.quaternion_to_rub(turn),
            sequence=counter,
            flags=flags,
        )

    def simulator(self, roles: Sequence[str]) -> "SimulatedViveUltimate":
        return SimulatedViveUltimate(self)


class SimulatedViveUltimate(SimulatedDevice):
    """A dongle whose trackers are paired and mapped: one report a tracker, unasked."""

    def __init__(self, protocol: ViveUltimate) -> None:
        self._order = _ORDERS[protocol.quaternion_order]
        self._packet = 0
        self._last: dict[int, TrackerSample] = {}

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        return [self._report(number, sample) for number, sample in enumerate(samples, start=1)]

    def _report(self, number: int, sample: TrackerSample) -> bytes:
        """A tracker that is not seen holds its place and says that it is lost."""
        self._packet = (self._packet + 1) % (1 << 16)
        status = LOST if sample.position is None else TRACKED
        if sample.position is not None:
            self._last[number] = sample
        shown = self._last.get(number, sample)
        turn = AXES.quaternion_from_rub(shown.orientation or IDENTITY)
        wire = [0.0] * 4
        for component, place in zip(turn, self._order, strict=True):
            wire[place] = component
        place = AXES.from_rub(shown.position or (0.0, 0.0, 0.0))
        ticks = round((sample.device_time_s or 0.0) * 1e5) % (1 << 16)
        address = bytes((0x23, 0x30 | number, 0x42, 0xB7, 0x82, 0xD3))
        head = _HEAD.pack(_TRACKER_DATA, self._packet, address, _POSE_TYPES[0], _POSE.size)
        pose = _POSE.pack(self._packet % 256, 0, *place, *wire, *(0.0,) * 6, ticks, status)
        return (head + pose).ljust(REPORT_SIZE, b"\0")
