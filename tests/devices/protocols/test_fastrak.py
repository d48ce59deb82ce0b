"""FASTRAK against the worked vectors, and its start-up conversation."""

import pytest

from devices.errors import DeviceError, SettingError
from devices.protocols.fastrak import Fastrak
from devices.protocols.protocol import SetBaud, run_dry
from devices.sample import SampleFlag
from tests.devices.protocols.wire import POSE_A_FRD, VECTORS, Wire, decode, started


def one(protocol, data):
    (sample,) = protocol.feed(data, 7)
    return sample


@pytest.mark.parametrize(
    ("vector", "options", "station", "tolerance"),
    [
        ("fastrak_ascii_O1,2,4,1_inch", {"binary": False, "inches": True, "items": (2, 4, 1)}, "1", 1.3e-4),
        ("fastrak_ascii_O2,2,11,1_cm", {"binary": False, "items": (2, 11, 1)}, "2", 1e-9),
        ("fastrak_binary_O1,2,11,0_cm", {}, "1", 1e-9),
    ],
)
def test_worked_vectors(vector, options, station, tolerance):
    sample = one(Fastrak(**options), VECTORS[vector])
    assert (sample.tracker, sample.host_time_ns, sample.flags) == (station, 7, SampleFlag.NONE)
    assert sample.position == pytest.approx(POSE_A_FRD.position, abs=tolerance)
    assert sample.orientation == pytest.approx(POSE_A_FRD.orientation, abs=1e-4)


@pytest.mark.parametrize(
    ("vector", "options"),
    [
        ("fastrak_ascii_O1,2,4,1_inch", {"binary": False, "inches": True, "items": (2, 4, 1)}),
        ("fastrak_ascii_O2,2,11,1_cm", {"binary": False, "items": (2, 11, 1)}),
        ("fastrak_binary_O1,2,11,0_cm", {}),
    ],
)
def test_the_simulator_writes_the_worked_vectors_byte_for_byte(vector, options):
    station = VECTORS[vector][1] - 0x30
    device = started(Fastrak(**options), station)
    assert device.measure([POSE_A_FRD] * station)[-1] == VECTORS[vector]


def test_columns_that_touch_are_cut_by_width():
    sample = one(Fastrak(binary=False, items=(2, 4, 1)), VECTORS["fastrak_ascii_touching_columns_cm"])
    assert sample.tracker == "3"
    assert sample.position == pytest.approx((-1.015, 0.33, 1.2025))


def test_an_error_letter_flags_the_sample():
    record = bytearray(VECTORS["fastrak_binary_O1,2,11,0_cm"])
    record[2] = ord("x")
    sample = one(Fastrak(), bytes(record))
    assert sample.flags == SampleFlag.SUSPECT
    assert sample.quality == pytest.approx(0.1)


def test_a_receiver_without_a_signal_gives_no_position():
    sample = one(Fastrak(), b"01k" + bytes(28) + b" ")
    assert (sample.position, sample.orientation, sample.flags) == (None, None, SampleFlag.SUSPECT)


def test_status_and_station_replies_are_the_documented_bytes():
    device = Fastrak().simulator(["a", "b"])
    device.answer(b"u")
    assert device.answer(b"S") == VECTORS["fastrak_status_S"]
    assert device.answer(b"l1\r") == VECTORS["fastrak_station_query_reply l1"]


def test_commands_may_come_byte_by_byte_and_case_matters():
    device = Fastrak().simulator(["a"])
    for byte in b"\rO1,2,11,0\rufC":
        device.answer(bytes([byte]))
    assert len(device.measure([POSE_A_FRD])[0]) == 32
    assert device.answer(b"P") == device.measure([POSE_A_FRD])[0]
    device.answer(b"c")
    assert device.measure([POSE_A_FRD]) == []


def test_start_finds_the_speed_and_sets_only_the_stations_that_are_on():
    wire = Wire(Fastrak().simulator(["a", "b", "c"]), bauds=(9600,))
    wire.run(Fastrak(hemisphere=(0, 0, 1)).start())
    assert b"O3,2,11,0\rH3,0,0,1\r" in wire.written
    assert b"O4" not in wire.written
    assert wire.written.endswith(b"ufC")


def test_silence_is_one_clear_line():
    with pytest.raises(DeviceError, match=r"FASTRAK at the port's speed, nor at 19200, .* baud: check its power"):
        Wire(Fastrak().simulator(["a"]), bauds=()).run(Fastrak().start())


def test_once_found_the_speed_is_kept():
    protocol = Fastrak()
    device = protocol.simulator(["a"])
    Wire(device, bauds=(9600,)).run(protocol.start())
    steps = run_dry(protocol.start(), iter([b"21S3F0 \r\n"]))
    assert [s for s in steps if isinstance(s, SetBaud)] == [SetBaud(9600)]


def test_recovery_re_initialises_a_device_that_does_not_answer_but_only_once():
    protocol = Fastrak()
    wire = Wire(protocol.simulator(["a"]), bauds=())
    for _ in range(6):
        with pytest.raises(DeviceError):
            wire.run(protocol.recover())
    assert wire.written.count(b"\x19") == 1


def test_a_refused_setting_and_a_list_without_an_end_are_named():
    with pytest.raises(SettingError, match="must end in 0 or 1"):
        Fastrak(items=(2, 11))
    with pytest.raises(SettingError, match="unknown item of the output list 7: use 0, 1, 2, 4, 11"):
        Fastrak(items=(2, 7, 0))
    replies = iter([b"21S3F0 \r\n", b"21l1100\r\n", b"2 E*ERROR* O1,2,11,0\r\n*ERROR* EC"])
    with pytest.raises(DeviceError, match="refuses"):
        run_dry(Fastrak().start(), replies)


def test_garbage_is_counted():
    protocol = Fastrak()
    record = VECTORS["fastrak_binary_O1,2,11,0_cm"]
    assert len(decode(protocol, [b"xyz", record])) == 1
    assert protocol.counters.bytes_dropped == 3
