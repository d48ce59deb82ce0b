"""A device that is unplugged, hangs or restarts comes back by itself and the session goes on."""

import time

import pytest

from devices.errors import DeviceError
from devices.reconnecting import RETRY_S, DeviceState, ReconnectingDevice
from devices.registry import make_device
from devices.simulators.pty_simulator import simulate_device
from tests.devices.motions import waving


def read_until(device: ReconnectingDevice, done, seconds: float = 15.0) -> None:
    """Reads until `done(reading)`. Fails when it never happens."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        if done(device.read(0.02)):
            return
    raise AssertionError("it never happened")


def test_a_cable_pulled_out_and_put_back_under_another_name(tmp_path):
    told = []
    with simulate_device(waving(2, 60.0), roles=("root", "head"), link=tmp_path / "port") as simulator:
        device = ReconnectingDevice(make_device("generic", str(tmp_path / "port*")), told.append)
        device.open()
        read_until(device, lambda reading: reading.samples)
        simulator.unplug()
        read_until(device, lambda _: device.state is DeviceState.GONE)
        simulator.replug()
        read_until(device, lambda reading: reading.samples)
        device.close()
    assert len(told) == 2
    assert "the device is gone" in told[0]
    assert told[1] == "generic: back"


def test_a_device_that_hangs_is_said_so_and_taken_up_again():
    told = []
    with simulate_device(waving(2, 60.0), roles=("root", "head")) as simulator:
        device = ReconnectingDevice(make_device("generic", simulator.path), told.append, silent_s=0.2)
        device.open()
        read_until(device, lambda reading: reading.samples)
        simulator.stall()
        read_until(device, lambda _: device.state is DeviceState.SILENT)
        simulator.stall(False)
        read_until(device, lambda reading: reading.samples)
        device.close()
    assert "silent for" in told[0]
    assert told[1] == "generic: streaming again"


def test_what_is_gone_is_looked_for_often_enough_to_be_back_within_two_seconds():
    """The generic device's start-up takes up to 0.7 s."""
    assert RETRY_S + 0.7 < 2.0


def test_a_device_that_is_not_there_at_the_start_is_an_error():
    with pytest.raises(DeviceError):
        ReconnectingDevice(make_device("generic", "/dev/ttyUSB77")).open()
