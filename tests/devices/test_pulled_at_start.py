"""A cable pulled while a device is being started: one clear error, and it starts when the cable is back."""

import threading
import time

import pytest

from devices.errors import DeviceError
from devices.protocols import protocols
from devices.reconnecting import DeviceState, ReconnectingDevice
from devices.registry import make_device
from devices.sample import ROLES
from devices.simulators.pty_simulator import simulate_device
from tests.devices.motions import waving

SERIAL = sorted(name for name, protocol in protocols().items() if protocol.link == "serial")


def streams(device, seconds=8.0):
    """Whether samples come within that time."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        if device.read(0.05).samples:
            return True
    return False


def open_and_read_for_ever(device):
    device.open()
    while True:
        device.read(0.05)


@pytest.mark.parametrize("name", SERIAL)
def test_opening_fails_with_one_line_or_is_lost_at_the_first_read(name, tmp_path):
    with simulate_device(waving(2, 60.0), name, roles=ROLES[:2], link=tmp_path / "port", loop=True) as simulator:
        for delay_s in (0.0, 0.03, 0.2):
            device = make_device(name, str(tmp_path / "port"))
            puller = threading.Timer(delay_s, simulator.unplug)
            puller.start()
            with pytest.raises(DeviceError) as caught:
                open_and_read_for_ever(device)
            puller.join()
            assert "\n" not in str(caught.value)
            device.close()
            simulator.replug()
        device = make_device(name, str(tmp_path / "port"))
        device.open()
        assert streams(device)
        device.close()


@pytest.mark.parametrize("name", ["fastrak", "generic", "ndi"])
def test_a_device_that_comes_back_and_goes_again_while_it_starts_is_taken_up_in_the_end(name, tmp_path):
    told: list[str] = []
    with simulate_device(waving(2, 60.0), name, roles=ROLES[:2], link=tmp_path / "port", loop=True) as simulator:
        device = ReconnectingDevice(make_device(name, str(tmp_path / "port")), told.append)
        device.open()
        assert streams(device)
        simulator.unplug()
        while device.state is not DeviceState.GONE:
            device.read(0.05)
        simulator.replug()
        again = [threading.Timer(0.1, simulator.unplug), threading.Timer(0.8, simulator.replug)]
        for change in again:
            change.start()
        while any(change.is_alive() for change in again):
            device.read(0.05)
        assert streams(device)
        assert device.state is DeviceState.STREAMING
        assert told[-1].endswith("back")
        device.close()
