"""Virtual HID devices: the kernel's messages, a conversation with a fake kernel, and the real `/dev/uhid` if any."""

import errno
import os
import shutil
import struct
import subprocess
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.errors import DeviceError
from devices.linked_device import LinkedDevice
from devices.protocols import make_protocol
from devices.protocols.generic_records import INFO_TYPE
from devices.protocols.hydra import mode_report
from devices.registry import make_device
from devices.sample import TrackerSample
from devices.simulators import uhid_events, uhid_port
from devices.simulators.source import measurements
from devices.simulators.uhid_events import DATA_MAX, EVENT_SIZE, EventType, HidIdentity, HostEvent, ReportType
from devices.simulators.uhid_simulator import UhidSimulator, identity_of, replies
from tests.devices.motions import waving
from tests.devices.uhid_kernel import FakeKernel, created, get_report, output, set_report

HEADER = Path("/usr/include/linux/uhid.h")
HID_DEVICES = ("generic-hid", "hydra", "vive_ultimate")
ROLES = ("left_wrist", "right_wrist")
TOLERANCE_M = 6e-4
identities = st.builds(
    HidIdentity,
    st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=127),
    st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=63),
    st.integers(0, 0xFFFF),
    st.integers(0, 0xFFFF),
    st.binary(min_size=1, max_size=DATA_MAX),
)


@given(identities)
def test_a_device_is_created_as_it_is_described(identity):
    assert created(uhid_events.pack_create(identity)) == identity


def test_names_that_are_too_long_are_cut_before_the_closing_zero():
    identity = created(uhid_events.pack_create(HidIdentity("p" * 300, "u" * 300, 1, 2, b"x")))
    assert (len(identity.product), len(identity.unique)) == (127, 63)


@given(st.binary(min_size=1, max_size=DATA_MAX), st.integers(0, 2**32 - 1), st.sampled_from(list(ReportType)))
def test_what_the_kernel_asks_is_understood(data, request, kind):
    assert uhid_events.unpack(set_report(request, data, kind)) == HostEvent(13, request, data[0], kind, data)
    assert uhid_events.unpack(get_report(request, data[0], kind)) == HostEvent(9, request, data[0], kind)
    assert uhid_events.unpack(output(data)) == HostEvent(6, 0, data[0], ReportType.OUTPUT, data)


@given(st.binary(max_size=EVENT_SIZE + 10))
def test_no_message_makes_trouble(message):
    event = uhid_events.unpack(message)
    replies(make_protocol("generic-hid").simulator(ROLES), event)
    assert len(event.data) <= DATA_MAX


@given(st.binary(min_size=1, max_size=DATA_MAX), st.integers(0, 2**32 - 1))
def test_reports_and_replies_lie_where_the_kernel_looks(report, request):
    assert uhid_events.pack_input(report) == struct.pack("=IH", 12, len(report)) + report
    reply = struct.pack("=IIHH", 10, request, 0, len(report)) + report
    assert uhid_events.pack_get_report_reply(request, report) == reply
    assert uhid_events.pack_get_report_reply(request, b"") == struct.pack("=IIHH", 10, request, errno.EIO, 0)
    assert uhid_events.pack_set_report_reply(request, True) == struct.pack("=IIH", 14, request, 0)
    assert uhid_events.pack_set_report_reply(request, False) == struct.pack("=IIH", 14, request, errno.EIO)
    assert uhid_events.pack_destroy() == struct.pack("=I", 1)


@pytest.mark.skipif(not (HEADER.exists() and shutil.which("cc")), reason="no kernel header, or no C compiler")
def test_sizes_and_places_are_those_of_the_kernels_header(tmp_path):
    places = {
        "sizeof(struct uhid_event)": EVENT_SIZE,
        "offsetof(struct uhid_event, u.create2.uniq)": 196,
        "offsetof(struct uhid_event, u.create2.rd_size)": 260,
        "offsetof(struct uhid_event, u.create2.rd_data)": 280,
        "offsetof(struct uhid_event, u.input2.data)": 6,
        "offsetof(struct uhid_event, u.output.size)": 4 + DATA_MAX,
        "offsetof(struct uhid_event, u.output.rtype)": 6 + DATA_MAX,
        "offsetof(struct uhid_event, u.get_report.rtype)": 9,
        "offsetof(struct uhid_event, u.get_report_reply.data)": 12,
        "offsetof(struct uhid_event, u.set_report.data)": 12,
        "offsetof(struct uhid_event, u.set_report_reply.err)": 8,
        "UHID_DATA_MAX": DATA_MAX,
        "BUS_USB": uhid_events.BUS_USB,
        **{f"UHID_{kind.name}": kind for kind in EventType},
        **{f"UHID_{kind.name}_REPORT": kind for kind in ReportType},
    }
    checks = "\n".join(f'_Static_assert({what} == {value:d}, "{what}");' for what, value in places.items())
    (tmp_path / "check.c").write_text(f"#include <stddef.h>\n#include <linux/uhid.h>\n{checks}\n")
    done = subprocess.run(["cc", "-fsyntax-only", tmp_path / "check.c"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def kernel(tmp_path):
    fake = FakeKernel(tmp_path)
    yield fake
    fake.end()


def simulator(name: str, kernel: FakeKernel, seconds: float = 1.0) -> UhidSimulator:
    protocol = make_protocol(name)
    source = measurements(waving(2, seconds), 60.0)
    identity = identity_of(protocol)
    return UhidSimulator(
        protocol.simulator(ROLES), source, identity, open_descriptor=kernel.descriptor, nodes=kernel.nodes
    )


def samples_of(device: LinkedDevice, count: int, seconds: float = 5.0) -> list[TrackerSample]:
    samples, end = [], time.perf_counter() + seconds
    while len(samples) < count and time.perf_counter() < end:
        samples += device.read(0.1).samples
    return samples


def check(read: list[TrackerSample]) -> None:
    """Each sample is one of those that were told, for each tracker in their order."""
    told = [sample for _, samples in measurements(waving(2, 1.0), 60.0) for sample in samples]
    for tracker in ("1", "2"):
        left = iter([sample.position for sample in told if sample.tracker == tracker])
        for sample in (sample for sample in read if sample.tracker == tracker):
            assert any(sample.position == pytest.approx(place, abs=TOLERANCE_M) for place in left)


@pytest.mark.parametrize("name", HID_DEVICES)
def test_a_virtual_device_is_found_started_and_read(name, kernel):
    with simulator(name, kernel) as played:
        assert played.path == "/dev/hidraw7"
        assert kernel.identity == identity_of(make_protocol(name))
        device = LinkedDevice(name, kernel, make_protocol(name))
        device.open()
        read = samples_of(device, 60)
        assert len(read) >= 60
        check(read)
        device.close()
        assert not any(kernel.errors)
    kernel.take_all()
    assert kernel.destroyed == 1


def test_nothing_moves_before_a_host_has_opened_the_device(kernel):
    with simulator("vive_ultimate", kernel) as played:
        assert not played.started.wait(0.2)
        kernel.open()
        assert played.started.wait(5)


def test_an_unplugged_device_comes_back_under_its_serial_number(kernel):
    with simulator("vive_ultimate", kernel, 60.0) as played:
        kernel.open()
        assert played.started.wait(5)
        played.unplug()
        kernel.take_all()
        assert kernel.destroyed == 1
        first, kernel.identity = kernel.identity, None
        (kernel.nodes / "hidraw7" / "device" / "uevent").unlink()
        assert played.replug() == "/dev/hidraw7"
        assert kernel.identity == first
        device = LinkedDevice("vive_ultimate", kernel, make_protocol("vive_ultimate"))
        device.open()
        assert samples_of(device, 4)


def test_a_stalled_device_says_nothing(kernel):
    with simulator("vive_ultimate", kernel, 60.0) as played:
        kernel.open()
        assert played.started.wait(5)
        played.stall()
        while kernel.read(0.3):
            pass
        assert kernel.read(0.2) == []
        played.stall(False)
        assert kernel.read(2.0)


def test_requests_that_a_device_has_no_answer_to_are_refused():
    generic, hydra = (make_protocol(name).simulator(ROLES) for name in ("generic-hid", "hydra"))
    refused = uhid_events.pack_get_report_reply(5, b"")
    assert replies(generic, uhid_events.unpack(get_report(5, 9))) == [refused]
    assert replies(generic, uhid_events.unpack(get_report(5, INFO_TYPE, ReportType.INPUT))) == [refused]
    assert replies(generic, uhid_events.unpack(get_report(5, INFO_TYPE))) != [refused]
    assert replies(hydra, uhid_events.unpack(set_report(6, mode_report(motion=True)))) == [
        uhid_events.pack_set_report_reply(6, True)
    ]
    assert hydra.streaming
    assert replies(hydra, uhid_events.unpack(output(b"\0\1"))) == []
    assert replies(hydra, uhid_events.unpack(struct.pack("=I", 77))) == []


def test_a_machine_without_uhid_says_what_would_help(tmp_path, monkeypatch):
    monkeypatch.setattr(uhid_port, "UHID", tmp_path / "uhid")
    with pytest.raises(DeviceError, match=r"uhid, which cannot be opened here .* try sudo modprobe uhid"):
        uhid_port.open_uhid()

    def forbidden(*_):
        raise PermissionError

    monkeypatch.setattr(uhid_port.os, "open", forbidden)
    with pytest.raises(DeviceError, match="may not write to: run as root"):
        uhid_port.open_uhid()


def test_a_refused_device_and_a_missing_node_are_said_so(tmp_path, kernel, monkeypatch):
    identity = identity_of(make_protocol("hydra"))
    read_only = tmp_path / "read_only"
    read_only.touch()
    with pytest.raises(DeviceError, match="refuses the simulated Razer Hydra"):
        uhid_port.UhidPort(identity, lambda: os.open(read_only, os.O_RDONLY))
    monkeypatch.setattr(uhid_port, "_NODE_PATIENCE_S", 0.05)
    port = uhid_port.UhidPort(identity, kernel.descriptor, tmp_path / "nowhere")
    with pytest.raises(DeviceError, match="no hidraw node"):
        _ = port.path
    port.unplug()


@pytest.mark.skipif(not os.access(uhid_port.UHID, os.R_OK | os.W_OK), reason="/dev/uhid is not here or not writable")
@pytest.mark.parametrize("name", HID_DEVICES)
def test_the_real_kernel_takes_it_for_a_device(name):
    protocol = make_protocol(name)
    source = measurements(waving(2, 1.0), 60.0)
    with UhidSimulator(protocol.simulator(ROLES), source, identity_of(protocol)) as played:
        if not os.access(played.path, os.R_OK | os.W_OK):
            pytest.skip(f"{played.path} is not ours to open")
        device = make_device(name, played.path)
        device.open()
        check(samples_of(device, 60))
        device.close()
