"""A simulated HID device that the kernel takes for a real one, report for report."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from devices.protocols.protocol import DeviceProtocol, SimulatedDevice
from devices.sample import TrackerSample
from devices.simulators import uhid_events
from devices.simulators.paced_simulator import PacedSimulator
from devices.simulators.uhid_events import EventType, HidIdentity, HostEvent, ReportType
from devices.simulators.uhid_port import HIDRAW, UhidPort, open_uhid

_TEST_NUMBERS = (0x1209, 0x0001)
"""Vendor and product number, of pid.codes, free for tests: for devices that are known by their reports."""


class UhidSimulator(PacedSimulator):
    """Plays a simulated device as a virtual HID device of Linux, see `PacedSimulator`.

    identity: as `identity_of` gives it. open_descriptor, nodes: see `UhidPort`.
    """

    def __init__(
        self,
        device: SimulatedDevice,
        source: Iterable[tuple[float, list[TrackerSample]]],
        identity: HidIdentity,
        *,
        pace: float | None = 1.0,
        open_descriptor: Callable[[], int] = open_uhid,
        nodes: Path = HIDRAW,
    ) -> None:
        self._uhid = UhidPort(identity, open_descriptor, nodes)
        super().__init__(device, source, self._uhid, pace=pace)

    def _converse(self) -> bool:
        event = self._uhid.read()
        if event is None:
            return False
        if not self.stalled:
            for message in replies(self._device, event):
                self._uhid.write(message)
        return True

    def _put(self, packet: bytes, patience_s: float) -> int:
        # USB asks a device for reports only while somebody has it open.
        sent = self._uhid.host_is_there and self._uhid.write(uhid_events.pack_input(packet))
        return len(packet) if sent else 0


def identity_of(protocol: DeviceProtocol) -> HidIdentity:
    """What the host finds this device by; its serial number is this process's own."""
    match = protocol.hid[0]
    vendor_id, product_id = match.vendor_id, match.product_id
    if vendor_id is None or product_id is None:
        vendor_id, product_id = _TEST_NUMBERS
    unique = f"sixpoint-{protocol.name}-{os.getpid()}"
    return HidIdentity(f"simulated {protocol.title}", unique, vendor_id, product_id, protocol.report_descriptor)


def replies(device: SimulatedDevice, event: HostEvent) -> list[bytes]:
    """What the device tells the kernel on one of its messages: requests are all answered, for the host waits."""
    if event.type == EventType.GET_REPORT:
        feature = event.report_type == ReportType.FEATURE
        report = device.get_feature(event.report_id, uhid_events.DATA_MAX) if feature else b""
        return [uhid_events.pack_get_report_reply(event.request, report)]
    if event.type == EventType.SET_REPORT:
        accepted = event.report_type != ReportType.INPUT
        done = [uhid_events.pack_set_report_reply(event.request, accepted)]
        if event.report_type == ReportType.FEATURE:
            device.set_feature(event.data)
        return done + (_said(device, event.data) if event.report_type == ReportType.OUTPUT else [])
    return _said(device, event.data) if event.type == EventType.OUTPUT else []


def _said(device: SimulatedDevice, report: bytes) -> list[bytes]:
    answer = device.answer(report)
    return [uhid_events.pack_input(answer)] if answer else []
