"""DWM1001 against the worked vectors, and the shell's quirks."""

import pytest

from devices.errors import DeviceError
from devices.protocols.dwm1001 import Dwm1001
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import VECTORS, Wire, decode, started

LINE = VECTORS["dwm1001_lep_line"]
TLV = VECTORS["dwm1001_TLV_pos_get_reply"]
PLACE = (1.25, 0.95, -3.4)
"""(1.25, 3.40, 0.95) m with z up."""
TOLD = TrackerSample("1", 0, PLACE, quality=0.72)


def test_line_vector():
    (sample,) = Dwm1001().feed(LINE, 7)
    assert (sample.tracker, sample.host_time_ns, sample.quality) == ("1", 7, 0.72)
    assert sample.position == pytest.approx(PLACE)
    assert sample.orientation is None


def test_binary_vector():
    (sample,) = Dwm1001(binary=True).feed(TLV, 7)
    assert sample.position == pytest.approx(PLACE)
    assert sample.quality == 0.72


def test_the_simulator_writes_the_vectors_byte_for_byte():
    assert started(Dwm1001(), 1).measure([TOLD]) == [LINE]
    tag = Dwm1001(binary=True).simulator(["a"])
    tag.measure([TOLD])
    assert tag.answer(b"\x02\x00") == TLV


@pytest.mark.parametrize(
    ("line", "tracker"),
    [
        (b"POS,2,0A1F,1.25,3.40,0.95,72,x0B\r\n", "0A1F"),
        (b"DIST,2,AN0,10D3,0.00,0.00,0.00,1.25,AN1,8A12,3.00,0.00,0.00,2.5,POS,1.25,3.40,0.95,72\r\n", "1"),
        (b"dwm> lep\r\ndwm> POS,1.25,3.40,0.95,72\r\n", "1"),
    ],
)
def test_listener_lines_distances_and_echoes(line, tracker):
    (sample,) = Dwm1001().feed(line, 0)
    assert (sample.tracker, sample.position) == (tracker, pytest.approx(PLACE))


def test_a_tag_without_a_fix_gives_no_position():
    (sample,) = Dwm1001().feed(b"POS,nan,nan,nan,0\r\n", 0)
    assert (sample.position, sample.quality, sample.flags) == (None, 0.0, SampleFlag.SUSPECT)


@pytest.mark.parametrize("line", [b"POS,1.25,3.40,0.95,172\r\n", b"POS,1.2,3.40,0.95,72\r\n", b"POS,1.25,3.40,72\r\n"])
def test_broken_lines_are_left_out(line):
    assert decode(Dwm1001(), [line, LINE]) == Dwm1001().feed(LINE, 0)


def test_printing_that_is_on_already_is_not_switched_off():
    device = started(Dwm1001(), 1)
    wire = Wire(device, samples=[TOLD])
    wire.run(Dwm1001().start())
    assert b"lep" not in wire.written
    wire.run(Dwm1001().stop())
    assert device.measure([TOLD]) == []
    wire.run(Dwm1001().start())
    assert device.measure([TOLD]) == [LINE], "printing goes on when the shell is entered again"


def test_binary_polls_ten_times_a_second_after_leaving_the_shell():
    device = started(Dwm1001(), 1)
    protocol = Dwm1001(binary=True)
    Wire(device, samples=[TOLD]).run(protocol.start())
    protocol.reset()
    device.measure([TOLD])
    assert protocol.feed(device.answer(protocol.to_send(0)), 0)[0].position == pytest.approx(PLACE)
    assert protocol.to_send(50_000_000) == b""
    assert protocol.to_send(100_000_000) == b"\x02\x00"


def test_silence_is_one_clear_line():
    with pytest.raises(DeviceError, match="stock firmware, at 115200 baud"):
        Wire(Dwm1001().simulator(["a"]), bauds=()).run(Dwm1001().start())
