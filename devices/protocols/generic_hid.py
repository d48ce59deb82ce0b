"""The generic binary records as HID reports: usage page 0xFF00, usage 1; no CRC, USB has its own.

Input report 1 is a sample, feature report 2 the device's info, feature report 3 a command.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from devices.axes import Axes
from devices.errors import DeviceError
from devices.protocols.generic_records import (
    COMMAND,
    COMMAND_TYPE,
    INFO,
    INFO_TYPE,
    SAMPLE,
    SAMPLE_TYPE,
    START,
    STOP,
    DeviceInfo,
    RecordReader,
    encode_sample,
)
from devices.protocols.protocol import DeviceProtocol, GetFeature, HidMatch, Script, SendFeature, SimulatedDevice
from devices.sample import TrackerSample


@dataclass
class GenericHid(DeviceProtocol):
    """axes: the device's frame, see `devices.axes`; its own info report overrides it."""

    name: ClassVar[str] = "generic-hid"
    title: ClassVar[str] = "Generic HID reports"
    link: ClassVar[Literal["serial", "hid"]] = "hid"
    hid: ClassVar[tuple[HidMatch, ...]] = (HidMatch(usage_page=0xFF00, usage=1, report_size=SAMPLE.size),)
    report_descriptor: ClassVar[bytes] = bytes.fromhex(
        "0600ff0901a101150026ff0075088501951f09028102850295330903b102850395030903b102c0"
    )
    rate_hz: ClassVar[float] = 100.0
    max_trackers: ClassVar[int] = 255

    axes: str = "RUB"

    def __post_init__(self) -> None:
        self._reader = RecordReader(Axes(self.axes), self.counters)

    def reset(self) -> None:
        super().reset()
        self._reader = RecordReader(Axes(self.axes), self.counters)

    def feed(self, data: bytes, host_time_ns: int) -> list[TrackerSample]:
        if len(data) == SAMPLE.size and data[0] == SAMPLE_TYPE:
            sample = self._reader.sample(data, host_time_ns)
            return [] if sample is None else [sample]
        self.counters.bytes_dropped += len(data)
        return []

    def start(self) -> Script:
        """Read its info, which also tells it from any other device on that usage page, then start."""
        info = DeviceInfo.decode((yield GetFeature(INFO_TYPE, INFO.size)))
        if info is None:
            raise DeviceError("this HID device has no generic tracker info report: is it another kind of device?")
        self.axes = info.axes
        yield SendFeature(COMMAND.pack(COMMAND_TYPE, START, round(self.rate_hz)))

    def stop(self) -> Script:
        yield SendFeature(COMMAND.pack(COMMAND_TYPE, STOP, 0))

    def simulator(self, roles: Sequence[str]) -> "SimulatedGenericHid":
        return SimulatedGenericHid(DeviceInfo(len(roles), round(self.rate_hz), self.axes, "sixpoint", "SIM1"))


@dataclass
class SimulatedGenericHid(SimulatedDevice):
    """Silent until it is started by feature report 3."""

    info: DeviceInfo
    streaming: bool = False
    _sequence: int = -1

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._sequence += 1
        axes = Axes(self.info.axes)
        return [encode_sample(s, self._sequence, axes) for s in samples] if self.streaming else []

    def set_feature(self, report: bytes) -> None:
        if len(report) == COMMAND.size and report[0] == COMMAND_TYPE and report[1] in (START, STOP):
            self.streaming = report[1] == START

    def get_feature(self, report_id: int, size: int) -> bytes:
        return self.info.encode()[:size] if report_id == INFO_TYPE else b""
