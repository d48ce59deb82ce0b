"""The driver on any link: HID too, and what has come is given before a loss is told."""

import pytest

from devices.errors import DeviceLost
from devices.linked_device import LinkedDevice
from devices.protocols import make_protocol
from devices.sample import ROLES
from devices.simulators.loopback import LoopbackLink
from devices.simulators.source import measurements
from tests.devices.motions import waving


def linked(name: str, trackers: int) -> tuple[LinkedDevice, LoopbackLink, object]:
    protocol = make_protocol(name)
    simulated = protocol.simulator(ROLES[:trackers])
    _, told = next(measurements(waving(trackers, 1.0), 60.0))
    link = LoopbackLink(simulated, streamed=lambda: simulated.measure(told))
    return LinkedDevice(name, link, protocol), link, simulated


@pytest.mark.parametrize(("name", "trackers"), [("hydra", 2), ("generic-hid", 6), ("vive_ultimate", 5)])
def test_hid_devices_are_started_and_read_report_by_report(name, trackers):
    device, link, simulated = linked(name, trackers)
    device.open()
    link.streamed = list
    assert device.read(0.0).chunks[0].data == b""
    device.read(0.0)
    motion = list(measurements(waving(trackers, 1.0), 60.0))
    for _, told in motion:
        link.deliver(simulated.measure(told))
        reading = device.read(0.0)
        assert {s.tracker for s in reading.samples} == {str(n) for n in range(1, trackers + 1)} or name != "generic-hid"
        assert len(reading.samples) == trackers
    device.close()
    assert simulated.measure(motion[0][1]) == [] or name != "generic-hid"


def test_what_has_come_is_given_before_a_loss_is_told(monkeypatch):
    device, link, _ = linked("generic", 2)
    device.open()
    device.read(0.0)
    # As a polled device, which is asked again as soon as it has answered.
    monkeypatch.setattr(device.protocol, "to_send", lambda now_ns: b"next?")
    unplug_after_read(link)
    assert device.read(0.05).chunks
    with pytest.raises(DeviceLost):
        device.read(0.0)
    device.close()


def unplug_after_read(link: LoopbackLink) -> None:
    """The cable goes between the next read that brings something and the request that follows it."""
    whole = link.read

    def read(timeout_s: float) -> list[bytes]:
        packets = whole(timeout_s)
        if packets:
            link.unplug()
        return packets

    link.read = read
