"""VIPER against the worked vectors, its units, and its start-up conversation."""

import struct
from math import radians

import pytest

from devices.errors import DeviceError
from devices.protocols._crc import crc16
from devices.protocols.protocol import run_dry
from devices.protocols.viper import CONTINUOUS, POSE, REFUSED, SET, UNITS, Viper, command_frame, frame
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import POSE_A_FRD, VECTORS, Wire, started

TWO_SENSORS = VECTORS["viper_pno_2_sensors_m_quat"]
SECOND = TrackerSample("2", 0, (0.1, -0.2, 0.3), (0.0, -0.0, -0.0, 1.0))
"""(-0.3, 0.1, 0.2) m forward, right, down, not turned."""


def test_pose_vector():
    first, second = Viper().feed(TWO_SENSORS, 7)
    assert (first.tracker, first.host_time_ns, first.sequence, first.quality) == ("1", 7, 1000, 1.0)
    assert first.position == pytest.approx(POSE_A_FRD.position)
    assert first.orientation == pytest.approx(POSE_A_FRD.orientation)
    assert second.tracker == "2"
    assert second.position == pytest.approx(SECOND.position)
    assert second.orientation == SECOND.orientation


def test_the_simulator_writes_the_vector_byte_for_byte():
    device = started(Viper(), 2)
    for _ in range(1000):
        sent = device.measure([POSE_A_FRD, SECOND])
    assert sent == [TWO_SENSORS]


def test_command_vectors():
    assert command_frame(CONTINUOUS, SET) == VECTORS["viper_cmd_continuous_set_no_payload"]
    assert command_frame(UNITS, SET, struct.pack("<II", 3, 2)) == VECTORS["viper_cmd_units_m_quat"]


def test_crc_check_values():
    assert crc16(b"123456789") == 0xBB3D
    assert crc16(b"123456789", 0xFFFF) == 0x4B37


@pytest.mark.parametrize(("unit", "per_metre"), [(0, 1 / 0.0254), (1, 1 / 0.3048), (2, 100.0), (3, 1.0)])
@pytest.mark.parametrize(("kind", "numbers"), [(0, (30, -20, 10, 0)), (1, (*map(radians, (30, -20, 10)), 0))])
def test_every_sensor_tells_its_own_units(unit, per_metre, kind, numbers):
    position = [value * per_metre for value in (0.3, -0.15, 0.45)]
    body = struct.pack("<IIIII3f4f", 1, 5, 0, 1, unit << 8 | kind << 10, *position, *numbers)
    (sample,) = Viper().feed(frame(POSE, body), 0)
    assert sample.position == pytest.approx(POSE_A_FRD.position, abs=1e-6)
    assert sample.orientation == pytest.approx(POSE_A_FRD.orientation, abs=1e-6)


def test_a_position_that_is_no_number_is_not_passed_on():
    body = struct.pack("<IIIII3f4f", 1, 5, 0, 1, 0xB00, float("nan"), 0, 0, 1, 0, 0, 0)
    (sample,) = Viper().feed(frame(POSE, body), 0)
    assert (sample.position, sample.flags) == (None, SampleFlag.SUSPECT)


def test_replies_among_the_poses_are_passed_over():
    protocol = Viper()
    assert len(protocol.feed(command_frame(CONTINUOUS, 3) + TWO_SENSORS, 0)) == 2
    assert protocol.counters.bytes_dropped == 0


def test_start_refused_or_unanswered_is_one_clear_line():
    with pytest.raises(DeviceError, match="no answer from Polhemus VIPER"):
        Wire(Viper().simulator(["a"]), bauds=()).run(Viper().start())
    with pytest.raises(DeviceError, match="no sensor: plug one in"):
        run_dry(Viper().start(), iter([command_frame(10, 3, bytes(4))]))
    replies = iter([command_frame(10, 3, b"\1\0\0\0"), command_frame(UNITS, REFUSED)])
    with pytest.raises(DeviceError, match="refuses metres and quaternions"):
        run_dry(Viper().start(), replies)
