"""Simulated devices on real pseudo-terminals, read with real pyserial."""

import os
import socket
import threading
import time
from itertools import pairwise

import pytest

from devices.driver import Driver
from devices.errors import DeviceError, DeviceLost, SettingError
from devices.linked_device import LinkedDevice
from devices.protocols import make_protocol
from devices.protocols.protocol import SerialFormat
from devices.registry import make_device
from devices.serial_link import SerialLink, find_port
from devices.simulators.pty_port import PtyPort
from devices.simulators.pty_simulator import PtySimulator, simulate_device
from devices.simulators.source import Faults, measurements
from tests.devices.motions import waving

ROLES = ("root", "head", "left_wrist", "right_wrist")


def read_all(device: Driver, simulator: PtySimulator) -> tuple[list, bytes]:
    """Samples and raw bytes until the simulated motion has ended and the line is silent."""
    samples, raw = [], b""
    while True:
        reading = device.read(0.15)
        samples += reading.samples
        raw += b"".join(chunk.data for chunk in reading.chunks)
        if not reading.chunks and simulator.finished.is_set():
            return samples, raw


def read_for_ever(device: Driver, into: list | None = None) -> None:
    """Reads until it raises; fails when it has not within some seconds."""
    end = time.perf_counter() + 10
    while time.perf_counter() < end:
        samples = device.read(0.1).samples
        if into is not None:
            into += samples
    raise AssertionError("the device was never lost")


@pytest.mark.parametrize("name", ["generic", "generic-binary"])
def test_every_sample_comes_through_byte_for_byte(name):
    motion = waving(4, 3.0)
    with simulate_device(motion, name, roles=ROLES, pace=None, quiet=True) as simulator:
        device = make_device(name, simulator.path)
        assert isinstance(device, Driver)
        device.open()
        samples, raw = read_all(device, simulator)
        device.close()
    expected = make_protocol(name).simulator(ROLES)
    assert raw == b"".join(p for _, told in measurements(motion, 60) for p in expected.measure(told))
    assert len(samples) == simulator.samples_sent == 4 * 181
    assert samples[-1].position == pytest.approx(motion.positions[-1, 3], abs=1e-4)
    assert all(a.host_time_ns <= b.host_time_ns for a, b in pairwise(samples))


def test_the_device_says_who_sits_where():
    with simulate_device(waving(4, 1.0), roles=ROLES) as simulator:
        device = make_device("generic", simulator.path, name="suit")
        device.open()
        assert device.role_hints == {"1": "root", "2": "head", "3": "left_wrist", "4": "right_wrist"}
        assert device.name == "suit"
        device.close()


def test_real_time_is_no_faster():
    with simulate_device(waving(1, 0.5), roles=ROLES[:1], quiet=True) as simulator:
        device = make_device("generic", simulator.path)
        device.open()
        samples, _ = read_all(device, simulator)
        device.close()
    assert len(samples) == 31
    assert (samples[-1].host_time_ns - samples[0].host_time_ns) * 1e-9 > 0.4


def test_noise_garbage_and_dropout_are_what_was_asked_for():
    motion = waving(4, 20.0)
    faults = Faults(noise_m=0.005, dropout=0.2, seed=1)
    with simulate_device(
        motion, "generic-binary", roles=ROLES, pace=None, quiet=True, faults=faults, garbage=0.3
    ) as simulator:
        device = make_device("generic-binary", simulator.path)
        device.open()
        samples, _ = read_all(device, simulator)
        device.close()
    assert len(samples) > 0.65 * simulator.samples_sent
    assert device.protocol.counters.bad_frames > 0
    lost = sum(s.position is None for s in samples) / len(samples)
    assert lost == pytest.approx(0.2, abs=0.07)
    errors = [
        s.position[0] - motion.positions[round(60 * (s.device_time_s or 0)), int(s.tracker) - 1, 0]
        for s in samples
        if s.position
    ]
    assert (sum(e * e for e in errors) / len(errors)) ** 0.5 == pytest.approx(0.005, rel=0.1)


def test_a_vanishing_port_is_lost_once_and_opens_again():
    with simulate_device(waving(2, 60.0), roles=ROLES[:2]) as simulator:
        device = make_device("generic", simulator.path)
        device.open()
        simulator.unplug()
        with pytest.raises(DeviceLost, match="gone"):
            read_for_ever(device)
        again = make_device("generic", simulator.replug())
        again.open()
        assert any(again.read(0.2).samples for _ in range(10))
        again.close()
        device.close()


def test_parity_and_modem_lines_that_a_port_has_not_are_put_up_with():
    port = PtyPort()
    link = SerialLink(port.path, SerialFormat(parity="E", data_bits=7))
    link.open()
    link.set_rts(True)
    link.set_baud(230400)
    link.send_break(0.01)
    port.write(b"hello")
    assert link.read(1.0) == [b"hello"]
    link.write(b"back")
    time.sleep(0.05)
    assert port.read() == b"back"
    link.close()
    port.unplug()


def test_a_link_keeps_the_name_over_replugging(tmp_path):
    port = PtyPort(tmp_path / "tracker")
    before = os.readlink(tmp_path / "tracker")
    assert before == port.path
    port.plug()
    assert os.readlink(tmp_path / "tracker") == port.path
    port.unplug()
    assert not (tmp_path / "tracker").exists()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(DeviceError, match="a file already"):
        PtyPort(tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"


def test_a_port_is_found_by_pattern(tmp_path):
    port = PtyPort(tmp_path / "tracker7")
    assert find_port(str(tmp_path / "tracker*")) == str(tmp_path / "tracker7")
    port.unplug()


def test_a_socket_is_a_port_too():
    server = socket.create_server(("127.0.0.1", 0))
    line = b"$TRKP,1,4211,70183250,0.3000,-0.1500,0.4500,,,,,98,87,0*%02X\r\n"
    body = line[1:].split(b"*")[0]
    check = 0
    for byte in body:
        check ^= byte

    def serve():
        connection, _ = server.accept()
        connection.settimeout(5)
        while b"TRKS,1" not in connection.recv(4096):
            pass
        connection.sendall(line % check)
        connection.close()

    thread = threading.Thread(target=serve)
    thread.start()
    device = make_device("generic", f"socket://127.0.0.1:{server.getsockname()[1]}")
    device.open()
    found = []
    with pytest.raises(DeviceLost):
        read_for_ever(device, found)
    thread.join()
    server.close()
    assert [sample.position for sample in found] == [(0.3, -0.15, 0.45)]


@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("/dev/ttyUSB77", "port /dev/ttyUSB77 does not exist; ports here: "),
        ("socket://127.0.0.1:1", "no connection"),
        (__file__, "is no serial port; ports here: "),
        (os.path.dirname(__file__), "is no serial port; ports here: "),
    ],
)
def test_a_port_that_does_not_open_is_one_clear_line(port, message):
    with pytest.raises(DeviceError, match=message) as caught:
        make_device("generic", port).open()
    assert "\n" not in str(caught.value)


def test_a_simulated_port_that_cannot_have_its_name_is_one_clear_line(tmp_path):
    (tmp_path / "mine.csv").write_text("")
    for name, message in (("nowhere/port", "cannot be made"), ("mine.csv", "there is a file already")):
        with pytest.raises(DeviceError, match=message):
            PtyPort(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.csv"]


def test_unknown_devices_and_options_list_the_valid_ones():
    with pytest.raises(SettingError, match=r"unknown device 'polhemus'.*generic"):
        make_device("polhemus")
    with pytest.raises(SettingError, match=r"unknown option of device generic 'axis'.*axes"):
        make_device("generic", options={"axis": "FRD"})
    with pytest.raises(SettingError, match="no baud rate"):
        make_device("generic-hid", baud=9600)


def test_a_port_in_use_is_refused():
    port = PtyPort()
    link = SerialLink(port.path, SerialFormat())
    link.open()
    with pytest.raises(DeviceError, match="in use"):
        SerialLink(port.path, SerialFormat()).open()
    link.close()
    port.unplug()


def test_start_up_that_fails_leaves_the_port_closed():
    port = PtyPort()
    device = make_device("fastrak", port.path)
    assert isinstance(device, LinkedDevice)
    threading.Timer(0.05, port.unplug).start()
    with pytest.raises(DeviceError):
        device.open()
    with pytest.raises(DeviceLost):
        device.link.read(0)
