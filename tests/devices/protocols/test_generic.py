"""The generic formats, against the worked vectors and against their own simulators."""

import pytest
from cobs import cobs

from devices.axes import Axes
from devices.errors import DeviceError
from devices.protocols import make_protocol
from devices.protocols.generic_binary import frame, record_in
from devices.protocols.generic_hid import GenericHid
from devices.protocols.generic_records import DeviceInfo, encode_sample
from devices.protocols.generic_text import sentence
from devices.protocols.protocol import run_dry
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import VECTORS, Wire, started

TEXT = VECTORS["generic_text_lines"]
POSE_A = pytest.approx((0.127679, -0.144878, 0.268536, 0.943714), abs=1e-4)


def test_text_vectors():
    protocol = make_protocol("generic")
    full, position_only, lost = protocol.feed(TEXT, 7)
    assert (full.tracker, full.sequence, full.host_time_ns) == ("1", 4211, 7)
    assert (full.position, full.quality, full.battery) == ((0.3, -0.15, 0.45), 0.98, 0.87)
    assert full.orientation == POSE_A
    assert full.device_time_s == pytest.approx(70.18325)
    assert (position_only.orientation, position_only.battery) == (None, None)
    assert (lost.position, lost.flags) == (None, SampleFlag.HELD)
    assert protocol.role_hints == {"1": "left_wrist"}
    assert protocol.counters.bytes_dropped == protocol.counters.bad_frames == 0


def test_text_is_encoded_as_the_vectors_have_it():
    protocol = make_protocol("generic")
    simulated = protocol.simulator(["root"])
    lines = TEXT.splitlines(keepends=True)
    for sample, line in zip(protocol.feed(TEXT, 0), lines[2:5], strict=True):
        assert simulated.encode(sample, 4211) == line
    assert lines[5:] == [sentence("TRKQ"), sentence("TRKS,1,60"), sentence("TRKS,0")]


@pytest.mark.parametrize(
    "body",
    [
        "TRKP,1,1,1,51,0,0,,,,,50,50,0",
        "TRKP,1,1,1,nan,0,0,,,,,50,50,0",
        "TRKP,1,1,1,0,0,0,0.5,0,0,0,50,50,0",
        "TRKP,1,1,1,0,0,0,,,,,101,50,0",
        "TRKP,1,1,1,x,0,0,,,,,50,50,0",
        "TRKP,1,1,1,0,0,0",
        "TRKI,1,n,s,6,60,RUF,p",
        "TRKN",
    ],
)
def test_text_with_a_good_checksum_and_bad_contents_is_a_bad_frame(body):
    protocol = make_protocol("generic")
    assert protocol.feed(sentence(body), 0) == []
    assert protocol.counters.bad_frames == 1
    assert protocol.options() == make_protocol("generic").options()


def test_text_checksum_may_be_left_out_only_where_that_is_said():
    line = TEXT.splitlines()[2].split(b"*")[0] + b"\r\n"
    assert make_protocol("generic").feed(line, 0) == []
    (sample,) = make_protocol("generic", require_checksum=False).feed(line, 0)
    assert sample.position == (0.3, -0.15, 0.45)


def test_text_and_binary_take_their_axes_from_the_device():
    for name in ("generic", "generic-binary"):
        protocol, simulated = make_protocol(name), make_protocol(name, axes="FLU").simulator(["root"])
        Wire(simulated).run(protocol.start())
        assert protocol.options()["axes"] == "FLU"
        sent = TrackerSample("1", 0, (0.1, 1.2, -0.3), (0.0, 0.6, 0.0, 0.8), 1.0)
        (got,) = protocol.feed(simulated.measure([sent])[0], 0)
        assert got.position == pytest.approx(sent.position, abs=1e-4)
        assert got.orientation == pytest.approx(sent.orientation, abs=1e-4)


def test_text_debug_prints_do_no_harm():
    protocol = make_protocol("generic")
    assert len(protocol.feed(b"booting...\r\n\xff\xfe" + TEXT + b"battery low\r\n", 0)) == 3


def test_running_numbers_tell_what_was_missed_and_clocks_run_on():
    protocol = make_protocol("generic")
    for number, t_us in ((65534, 2**32 - 20), (65535, 2**32 - 10), (2, 20)):
        (last,) = protocol.feed(sentence(f"TRKP,1,{number},{t_us},0,0,0,,,,,,,0"), 0)
    assert protocol.counters.missed == 2
    assert last.device_time_s == pytest.approx((2**32 + 20) * 1e-6)


def test_binary_vectors():
    wire, record = VECTORS["generic_serial_binary_COBS"], VECTORS["generic_hid_report_id1_32_bytes"]
    (sample,) = make_protocol("generic-binary").feed(wire, 0)
    assert make_protocol("generic-hid").feed(record, 0) == [sample]
    assert sample.position == pytest.approx((0.3, -0.15, 0.45))
    assert sample.orientation == POSE_A
    assert (sample.tracker, sample.sequence, sample.quality, sample.battery) == ("1", 4211, 0.98, 0.87)
    assert sample.device_time_s == pytest.approx(70.18325)
    assert encode_sample(sample, 4211, Axes("RUB")) == record
    assert b"\0" + frame(record) == wire
    info = DeviceInfo(6, 60, "RUB", "diy-uwb", "A1B2")
    assert info.encode() == VECTORS["generic_info_type2"]
    assert DeviceInfo.decode(info.encode()) == info


def test_binary_unknown_records_are_skipped_and_bad_ones_counted():
    protocol = make_protocol("generic-binary")
    assert protocol.feed(b"\0" + frame(bytes([9, 1, 2, 3])), 0) == []
    assert protocol.counters.bad_frames == 0
    assert protocol.feed(cobs.encode(b"\1\2\3\4\5") + b"\0", 0) == []
    assert protocol.counters.bad_frames == 1
    assert record_in(b"\5\1") is None


@pytest.mark.parametrize("change", [{"position": (60.0, 0, 0)}, {"orientation": (0.1, 0.1, 0.1, 0.1)}])
def test_binary_numbers_beyond_sense_are_bad_frames(change):
    sample = TrackerSample("1", 0, **({"position": (0.0, 0, 0)} | change), device_time_s=0.0)
    protocol = make_protocol("generic-binary")
    assert protocol.feed(frame(encode_sample(sample, 0, Axes("RUB"))), 0) == []
    assert protocol.counters.bad_frames == 1


@pytest.mark.parametrize("name", ["generic", "generic-binary", "generic-hid"])
def test_flags_survive(name):
    protocol = make_protocol(name)
    device = started(protocol, 1)
    for flags in (SampleFlag.NONE, SampleFlag.ESTIMATED, SampleFlag.BUTTON | SampleFlag.CHARGING, SampleFlag.HELD):
        sent = TrackerSample("1", 0, (0.0, 1.0, 0.0), None, 1.0, quality=0.5, flags=flags)
        (got,) = protocol.feed(device.measure([sent])[0], 0)
        assert (got.flags, got.quality, got.battery) == (flags, 0.5, None)


def test_hid_without_the_info_report_is_another_device():
    with pytest.raises(DeviceError, match="info report"):
        run_dry(GenericHid().start(), iter([b"\2\7"]))
