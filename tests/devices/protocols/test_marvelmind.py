"""Marvelmind packets against the worked vector and the other packet types."""

import struct

import pytest

from devices.errors import DeviceError
from devices.protocols.marvelmind import FUSION, POSITION_CM, Marvelmind, packet
from devices.protocols.protocol import run_dry
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import VECTORS, Wire

VECTOR = VECTORS["marvelmind_0x0011_mm"]
PLACE = (1.25, 0.95, -3.4)
"""(1.25, 3.40, 0.95) m with z up."""


def test_vector():
    (sample,) = Marvelmind().feed(VECTOR, 7)
    assert (sample.tracker, sample.host_time_ns, sample.device_time_s) == ("12", 7, 60.0)
    assert sample.position == pytest.approx(PLACE)


def test_the_simulator_writes_the_vector_byte_for_byte():
    told = TrackerSample("12", 0, PLACE, device_time_s=60.0)
    assert Marvelmind().simulator(["a"] * 12).measure([told] * 12)[-1] == VECTOR


def test_centimetres():
    (sample,) = Marvelmind().feed(packet(POSITION_CM, struct.pack("<IhhhBBH2x", 1000, 125, 340, 95, 0, 5, 0)), 0)
    assert (sample.tracker, sample.position) == ("5", pytest.approx(PLACE))


def test_fusion_has_a_turn():
    payload = struct.pack("<iii4h3h3h2xI4x", 1250, 3400, 950, 7071, 0, 0, 7071, *(0,) * 6, 5000)
    (sample,) = Marvelmind().feed(packet(FUSION, payload), 0)
    assert (sample.tracker, sample.position, sample.device_time_s) == ("fusion", pytest.approx(PLACE), 5.0)
    assert sample.orientation == pytest.approx((0, 0.5**0.5, 0, 0.5**0.5))


def test_coordinates_that_the_device_calls_unavailable_are_not_passed_on():
    payload = VECTOR[5:21] + b"\x01" + VECTOR[22:-2]
    (sample,) = Marvelmind().feed(packet(0x11, payload), 0)
    assert (sample.tracker, sample.position, sample.flags) == ("12", None, SampleFlag.SUSPECT)


def test_other_packets_are_passed_over():
    protocol = Marvelmind()
    assert len(protocol.feed(packet(0x06, bytes(16)) + VECTOR, 0)) == 1
    assert protocol.counters.bytes_dropped == 0


def test_start_listens_at_each_speed_and_writes_nothing():
    protocol = Marvelmind()
    wire = Wire(protocol.simulator(["a"]), bauds=(19200,), samples=[TrackerSample("1", 0, PLACE)])
    wire.run(protocol.start())
    assert (wire.written, protocol.found_baud) == (b"", 19200)
    with pytest.raises(DeviceError, match='switch "streaming" on'):
        run_dry(Marvelmind().start(), iter(()))
