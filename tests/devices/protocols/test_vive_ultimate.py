"""VIVE Ultimate dongle against the worked vector, and that nothing is ever written to it."""

from dataclasses import replace

import pytest

from devices.errors import SettingError
from devices.protocols import without_position
from devices.protocols.protocol import run_dry
from devices.protocols.vive_ultimate import LOST, ROTATION_ONLY, ViveUltimate
from devices.protocols.without_position import why_no_position
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import VECTORS

REPORT = VECTORS["vive_ultimate_pose_report"]
PLACE = (0.3, -0.15, 0.45)
TURN = (0.127679, -0.144878, 0.268536, 0.943714)
STATUS_AT = 48


def with_status(status: int) -> bytes:
    return REPORT[:STATUS_AT] + bytes([status]) + REPORT[STATUS_AT + 1 :]


def test_vector():
    (sample,) = ViveUltimate().feed(REPORT, 7)
    assert (sample.tracker, sample.host_time_ns, sample.sequence, sample.flags) == ("1", 7, 0x5A, SampleFlag.NONE)
    assert sample.position == pytest.approx(PLACE)
    assert sample.orientation == pytest.approx(TURN, abs=5e-4)


@pytest.mark.parametrize("report", [b"\0" + REPORT, REPORT[:9] + b"\x01\x10" + REPORT[11:]])
def test_a_leading_report_id_and_the_other_byte_order_of_the_type_are_put_up_with(report):
    assert ViveUltimate().feed(report, 0) == ViveUltimate().feed(REPORT, 0)


def test_a_lost_tracker_is_held_and_one_that_only_turns_has_no_position():
    (lost,) = ViveUltimate().feed(with_status(LOST), 0)
    assert (lost.position, lost.flags) == (pytest.approx(PLACE), SampleFlag.HELD)
    (turning,) = ViveUltimate().feed(with_status(ROTATION_ONLY), 0)
    assert turning.position is None
    assert turning.orientation == pytest.approx(TURN, abs=5e-4)


@pytest.mark.parametrize("report", [b"\x18" + REPORT[1:], REPORT[:11] + b"\x02" + REPORT[12:], REPORT[:40], b""])
def test_other_reports_give_nothing(report):
    assert ViveUltimate().feed(report, 0) == []


def test_the_simulator_writes_the_vector_but_for_its_counters():
    told = TrackerSample("1", 0, PLACE, TURN, device_time_s=0.01234)
    (sent,) = ViveUltimate().simulator(["a"]).measure([told])
    assert sent[3:12] == REPORT[3:12]
    assert sent[13:] == REPORT[13:]


def test_other_orders_of_the_quaternion():
    device = ViveUltimate(quaternion_order="wxyz").simulator(["a"])
    (report,) = device.measure([TrackerSample("1", 0, PLACE, TURN)])
    assert ViveUltimate(quaternion_order="wxyz").feed(report, 0)[0].orientation == pytest.approx(TURN, abs=1e-3)
    with pytest.raises(SettingError, match="use xyzw, wxyz, wzyx"):
        ViveUltimate(quaternion_order="zyxw")


def test_nothing_is_ever_written():
    protocol = ViveUltimate()
    for script in (protocol.start(), protocol.recover(), protocol.stop()):
        assert run_dry(script, iter(())) == []
    assert protocol.to_send(0) == b""


def test_devices_without_position_are_named_with_the_reason():
    assert "bone lengths" in (why_no_position(0x1209, 0x7690) or "")
    assert "lighthouse solver" in (why_no_position(0x28DE, 0x2022) or "")
    assert why_no_position(0x1532, 0x0300) is None
    assert all(replace(d).reason for d in without_position.WITHOUT_POSITION)
