"""IS-900 and ISOTRAK II, whose records are packed into 7-bit bytes."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.errors import SettingError
from devices.protocols._phase_words import scaled, word_bytes, words
from devices.protocols.is900 import Is900
from devices.protocols.isotrak2 import Isotrak2, pack7, unpack7
from devices.sample import SampleFlag
from tests.devices.protocols.wire import POSE_A_FRD, VECTORS, Wire, started

IS900 = VECTORS["is900_binary_O1,18,20"]
ISOTRAK = VECTORS["isotrak2_binary_O2,11"]


def test_is900_vector():
    (sample,) = Is900(items=(18, 20)).feed(IS900, 7)
    assert (sample.tracker, sample.host_time_ns) == ("1", 7)
    assert sample.position == pytest.approx((-0.15015, -0.44971, -0.29993), abs=5e-6)
    assert sample.orientation == pytest.approx(POSE_A_FRD.orientation, abs=2e-4)


def test_is900_stations_are_hexadecimal_and_its_simulator_answers_54_bytes():
    protocol = Is900()
    device = started(protocol, 12)
    assert [s.tracker for s in protocol.feed(b"".join(device.measure([POSE_A_FRD] * 12)), 0)][-3:] == ["10", "11", "12"]
    assert len(device.answer(b"S")) == 54


def test_is900_has_no_error_letters():
    protocol = Is900()
    record = started(protocol, 1).measure([POSE_A_FRD])[0]
    assert protocol.feed(record[:2] + b"x" + record[3:], 0) == []


def test_is900_clock():
    protocol = Is900(items=(18, 21, 20))
    (record,) = started(protocol, 1).measure([replace(POSE_A_FRD, device_time_s=1.5)])
    assert protocol.feed(record, 0)[0].device_time_s == 1.5


def test_packed_items_have_no_text_form():
    with pytest.raises(SettingError, match="item 18 of the output list has no text form"):
        Is900(items=(18, 1), binary=False)


def test_isotrak_vector():
    assert unpack7(ISOTRAK).hex(" ") == "30 31 40 16 17 75 f4 a2 22 cb 78 58 10 75 ed 5f 22"
    (sample,) = Isotrak2().feed(ISOTRAK, 7)
    assert (sample.tracker, sample.flags) == ("1", SampleFlag.BUTTON)
    assert sample.position == pytest.approx(POSE_A_FRD.position, abs=3e-5)
    assert sample.orientation == pytest.approx(POSE_A_FRD.orientation, abs=5e-5)


def test_the_isotrak_simulator_writes_the_vector_byte_for_byte():
    told = replace(POSE_A_FRD, flags=SampleFlag.BUTTON)
    assert started(Isotrak2(), 1).measure([told]) == [ISOTRAK]


def test_an_isotrak_receiver_out_of_reach_sends_nothing():
    far = replace(POSE_A_FRD, position=(0.0, 1.7, 0.0))
    assert started(Isotrak2(), 2).measure([far, POSE_A_FRD])[0][1:2] == b"2"


def test_isotrak_start_says_what_the_notes_list():
    wire = Wire(Isotrak2().simulator(["a"]))
    wire.run(Isotrak2().start())
    assert wire.written.endswith(b"O2,11\rR1\rb1\rR2\rb2\rufC")


@given(st.binary(min_size=1, max_size=40))
def test_packing_into_seven_bits_goes_back(data):
    wire = pack7(data)
    assert unpack7(wire) == data
    assert wire[0] & 0x80
    assert wire[1:].isascii()


@given(st.floats(-1, 1), st.sampled_from([0.9144, 3.0, 180.0]))
def test_words_are_within_half_a_step(share, full_scale):
    value = share * full_scale
    (back,) = words(word_bytes([scaled(value, full_scale)]))
    assert back % 4 == 0
    assert abs(back / 32768 * full_scale - value) <= full_scale / 8192
