"""LIBERTY and PATRIOT against the worked vectors, and their start-up conversation."""

from dataclasses import replace

import pytest

from devices.errors import DeviceError
from devices.protocols.liberty import Liberty, Patriot
from devices.sample import SampleFlag
from tests.devices.protocols.wire import POSE_A_FRD, VECTORS, Wire, decode, started

LIBERTY_RECORD = VECTORS["liberty_binary_O*,8,9,11,3,7_inch"]


def test_liberty_vector():
    (sample,) = Liberty(inches=True).feed(LIBERTY_RECORD, 7)
    assert (sample.tracker, sample.host_time_ns, sample.sequence, sample.device_time_s) == ("1", 7, 7890, 123.456)
    assert sample.position == pytest.approx(POSE_A_FRD.position, abs=1e-6)
    assert sample.orientation == pytest.approx(POSE_A_FRD.orientation, abs=1e-6)
    assert sample.flags == SampleFlag.NONE


def test_patriot_vector():
    (sample,) = Patriot(items=(2, 4)).feed(VECTORS["patriot_binary_O*,2,4_cm"], 7)
    assert (sample.tracker, sample.device_time_s) == ("2", None)
    assert sample.position == pytest.approx(POSE_A_FRD.position, abs=1e-6)
    assert sample.orientation == pytest.approx(POSE_A_FRD.orientation, abs=1e-6)


def test_the_simulators_write_the_worked_vectors_byte_for_byte():
    told = replace(POSE_A_FRD, device_time_s=123.456)
    device = Liberty().simulator(["a"])
    device.answer(b"F1\rU0\rO*,8,9,11,3,7\rC\r")
    for _ in range(7890):
        sent = device.measure([told])
    assert sent == [LIBERTY_RECORD]
    patriot = started(Patriot(items=(2, 4)), 2)
    assert patriot.measure([told, told])[1] == VECTORS["patriot_binary_O*,2,4_cm"]


def test_station_map_reply():
    reply = bytearray(Liberty().simulator(["a", "b"]).answer(b"\x150\r"))
    reply[8] = 0x0F  # the vector has four sensors plugged in of which two are on
    assert bytes(reply) == VECTORS["liberty_station_map_reply_^U"]


@pytest.mark.parametrize(("error", "flags"), [(b"u", SampleFlag.SUSPECT), (b"a", SampleFlag.SUSPECT), (b"\0", 0)])
def test_the_error_byte_flags_the_sample(error, flags):
    (sample,) = Liberty(inches=True).feed(LIBERTY_RECORD[:4] + error + LIBERTY_RECORD[5:], 0)
    assert sample.flags == flags


def test_a_frame_count_that_jumps_is_counted_as_missed():
    later = LIBERTY_RECORD[:12] + (7894).to_bytes(4, "little") + LIBERTY_RECORD[16:]
    protocol = Liberty(inches=True)
    decode(protocol, [LIBERTY_RECORD, later])
    assert protocol.counters.missed == 3


def test_the_device_clock_runs_on_when_it_wraps():
    late = LIBERTY_RECORD[:8] + b"\xff\xff\xff\xff" + LIBERTY_RECORD[12:]
    early = LIBERTY_RECORD[:8] + b"\x04\0\0\0" + LIBERTY_RECORD[12:]
    first, second = decode(Liberty(inches=True), [late, early])
    assert second.device_time_s - first.device_time_s == pytest.approx(0.005)


def test_start_sets_unit_and_list_and_finds_the_speed():
    wire = Wire(Liberty().simulator(["a"]), bauds=(19200,))
    wire.run(Liberty(hemisphere=(0, 0, -1)).start())
    assert wire.written.endswith(b"U1\rO*,8,9,11,3,7\rH*,0,0,-1\rC\r")


def test_no_sensor_and_no_answer_are_one_clear_line():
    with pytest.raises(DeviceError, match="no active sensor: plug one in"):
        Wire(Liberty().simulator([])).run(Liberty().start())
    with pytest.raises(DeviceError, match="its USB port is no serial port"):
        Wire(Liberty().simulator(["a"]), bauds=()).run(Liberty().start())
