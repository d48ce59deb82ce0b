"""Razer Hydra against a report of a real unit and a made one, its modes and its two hemispheres."""

from math import cos, sin

import pytest

from devices.errors import DeviceError
from devices.protocols.hydra import Hydra, mode_report
from devices.protocols.protocol import SendFeature, run_dry
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import VECTORS, decode, started

REAL = VECTORS["hydra_real_capture_log.csv_line1"]
MADE = VECTORS["hydra_synthetic"]


def test_the_real_report():
    left, right = Hydra().feed(REAL, 7)
    assert (left.tracker, right.tracker) == ("1", "2")
    assert (left.host_time_ns, left.sequence, left.flags) == (7, 99, SampleFlag.NONE)
    assert left.position == pytest.approx((0.047, 0.052, -0.065))
    assert right.position == pytest.approx((-0.042, 0.054, -0.068))
    w, x, y, z = (value / 32766.2 for value in (-8481, 31100, 1825, -5581))
    assert left.orientation == pytest.approx((x, -z, y, w), abs=1e-4)


def test_the_made_report():
    left, right = Hydra().feed(MADE, 0)
    assert left.position == pytest.approx((-0.25, 0.3, -0.1))
    assert left.orientation == pytest.approx((0.127679, -0.268536, -0.144878, 0.943714), abs=1e-4)
    assert left.flags == SampleFlag.BUTTON
    assert right.position == pytest.approx((0.25, 0.28, -0.12))
    assert right.flags == SampleFlag.BUTTON


def test_the_simulator_writes_the_made_report():
    left, right = Hydra().feed(MADE, 0)
    device = started(Hydra(), 2)
    for _ in range(7):
        (sent,) = device.measure([left, right])
    same = [*range(6, 22), *range(28, 44)]
    assert sent[:6] == MADE[:6]
    assert all(abs(sent[i] - MADE[i]) <= 1 for i in same), "but for the rounding of turns that came back"
    assert decode(Hydra(), [sent])[0].position == pytest.approx(left.position)


def test_mode_reports():
    assert mode_report(motion=True) == VECTORS["hydra_feature_start_motion"]
    assert (mode_report(motion=False)[9], mode_report(motion=False)[89]) == (0, 5)


def test_a_wrong_checksum_is_left_out_unless_allowed():
    broken = REAL[:10] + b"\0" + REAL[11:]
    strict, lenient = Hydra(), Hydra(require_checksum=False)
    assert (strict.feed(broken, 0), len(lenient.feed(broken, 0))) == ([], 2)
    assert strict.counters.bad_frames == lenient.counters.bad_frames == 1


def test_a_wand_that_dives_below_the_base_and_comes_up_again_makes_no_jump():
    protocol = Hydra()
    device = started(protocol, 2)
    path = [(0.3 * cos(t / 50), 0.25 * sin(t / 25) + 0.05, -0.2 - 0.1 * sin(t / 40)) for t in range(400)]
    assert min(y for _, y, _ in path) < -0.15
    for place in path:
        left, right = decode(protocol, device.measure([TrackerSample("1", 0, place), TrackerSample("2", 0, path[0])]))
        assert left.position == pytest.approx(place, abs=6e-4)
        assert right.position == pytest.approx(path[0], abs=6e-4)


def test_missing_reports_are_counted():
    protocol = Hydra()
    device = started(protocol, 2)
    packets = [device.measure([TrackerSample("1", 0, (0.1, 0.2, 0.1))] * 2)[0] for _ in range(5)]
    decode(protocol, [packets[0], packets[4]])
    assert protocol.counters.missed == 2 * 3


def test_a_base_that_streams_already_is_left_alone_and_a_gamepad_is_switched():
    assert not any(isinstance(s, SendFeature) for s in run_dry(Hydra().start(), iter([REAL])))
    assert SendFeature(mode_report(motion=True)) in run_dry(Hydra().start(), iter([bytes(12), bytes(12), REAL]))
    with pytest.raises(DeviceError, match="stays a gamepad"):
        run_dry(Hydra().start(), iter(()))
