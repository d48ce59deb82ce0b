"""A device that is unplugged, hangs or restarts comes back by itself and the session goes on."""

import time

import pytest

from devices.errors import DeviceError
from devices.reconnecting import DeviceState, ReconnectingDevice
from devices.registry import make_device
from devices.simulators.pty_simulator import simulate_device
from tests.devices.motions import waving


def read_until(device: ReconnectingDevice, done, seconds: float = 4.0) -> float:
    """Reads until `done(reading)`; returns the seconds it took. Fails when it never happens."""
    start = time.perf_counter()
    while time.perf_counter() - start < seconds:
        if done(device.read(0.02)):
            return time.perf_counter() - start
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
        assert read_until(device, lambda reading: reading.samples) < 2.0
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
        assert read_until(device, lambda reading: reading.samples) < 2.0
        device.close()
    assert "silent for" in told[0]
    assert told[1] == "generic: streaming again"


def test_a_device_that_is_not_there_at_the_start_is_an_error():
    with pytest.raises(DeviceError):
        ReconnectingDevice(make_device("generic", "/dev/ttyUSB77")).open()
