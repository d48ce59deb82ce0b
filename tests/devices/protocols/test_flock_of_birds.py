"""Flock of Birds against the worked vectors, and its start-up conversation."""

import pytest

from devices.errors import DeviceError, SettingError
from devices.protocols.flock_of_birds import FlockOfBirds
from devices.protocols.protocol import Pause, SetRts, run_dry
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import POSE_A_FRD, VECTORS, Wire, decode, started

TWO_BIRDS = VECTORS["fob_group_posquat_two_birds_36in"]
ONE_BIRD_72 = VECTORS["fob_posquat_single_72in"]
SECOND = TrackerSample("2", 0, (0.1, -0.2, 0.3), (0.0, 0.0, 0.0, 1.0))
"""(-0.3, 0.1, 0.2) m forward, right, down, not turned."""


def test_two_birds_in_a_group():
    first, second = FlockOfBirds().feed(TWO_BIRDS, 7)
    assert (first.tracker, first.host_time_ns) == ("1", 7)
    assert first.position == pytest.approx((-0.15002, -0.44994, -0.29993), abs=5e-6)
    assert first.orientation == pytest.approx(POSE_A_FRD.orientation, abs=2e-4)
    assert second.tracker == "2"
    assert second.position == pytest.approx(SECOND.position, abs=1.2e-4)
    assert second.orientation == pytest.approx(SECOND.orientation, abs=1e-4)


def test_one_bird_with_the_doubled_scale():
    (sample,) = FlockOfBirds(full_scale_in=72, group=False).feed(ONE_BIRD_72, 0)
    assert sample.position == pytest.approx(POSE_A_FRD.position, abs=2.3e-4)


def within_one_step(sent: bytes, vector: bytes) -> bool:
    """Whether each 14-bit word is at most one step off: rounding is not part of the format."""
    assert [byte & 0x80 for byte in sent] == [byte & 0x80 for byte in vector]
    pairs = zip(sent[:14:2], sent[1:14:2], vector[:14:2], vector[1:14:2], strict=True)
    return all(abs((a & 127 | b << 7) - (c & 127 | d << 7)) <= 1 for a, b, c, d in pairs)


def test_the_simulator_writes_the_vectors():
    sent = started(FlockOfBirds(), 2).measure([POSE_A_FRD, SECOND])
    assert within_one_step(sent[0], TWO_BIRDS[:15])
    assert within_one_step(sent[1], TWO_BIRDS[15:])
    assert [packet[-1] for packet in sent] == [1, 2]
    assert within_one_step(
        started(FlockOfBirds(full_scale_in=72, group=False), 1).measure([POSE_A_FRD])[0], ONE_BIRD_72
    )


def test_start_says_what_the_notes_list():
    wire = Wire(FlockOfBirds().simulator(["a", "b"]))
    wire.run(FlockOfBirds().start())
    listed = bytes.fromhex("503202 502301 F15D F25D F14C0000 F24C0000")
    assert listed in wire.written.replace(b"\x42\x4f\x24", b"")
    assert wire.written.startswith(b"\x42\x4f\x24")
    assert wire.written.endswith(b"\x4f\x24\x40")


def test_a_flock_held_in_reset_is_let_go_and_only_then_reset():
    status = bytes([0xE0, 0xE0, *bytes(12)])
    steps = run_dry(FlockOfBirds().start(), iter([b"", status, status, status, status]))
    assert [s for s in steps if isinstance(s, SetRts)] == [SetRts(False), SetRts(True), SetRts(False), SetRts(False)]
    quick = run_dry(FlockOfBirds().start(), iter([status] * 4))
    assert [s for s in quick if isinstance(s, SetRts)] == [SetRts(False)]
    assert not any(isinstance(s, Pause) for s in quick), "a flock that runs already is not configured anew"


def test_recovery_resets_a_flock_only_now_and_then():
    protocol = FlockOfBirds()
    resets = []
    for _ in range(8):
        wire = Wire(protocol.simulator(["a"]), bauds=())
        with pytest.raises(DeviceError):
            wire.run(protocol.recover())
        resets.append(wire.resets)
    assert resets == [0, 0, 0, 1, 0, 0, 0, 1]


def test_an_extended_range_transmitter_shifts_the_addresses():
    device = started(FlockOfBirds(first_address=2, full_scale_in=144), 2)
    sent = device.measure([POSE_A_FRD, SECOND])
    assert [packet[-1] for packet in sent] == [2, 3]


def test_a_bird_out_of_reach_has_no_position():
    far = TrackerSample("1", 0, (0.0, 1.6, 0.0))
    for full_scale_in, seen in ((36, False), (72, True)):
        protocol = FlockOfBirds(full_scale_in=full_scale_in)
        (sample,) = decode(protocol, started(protocol, 1).measure([far]))
        assert (sample.position is not None) == seen


def test_zeros_are_no_position():
    (sample,) = FlockOfBirds().feed(b"\x80" + bytes(13) + b"\x01", 0)
    assert (sample.position, sample.flags) == (None, SampleFlag.SUSPECT)


def test_a_phase_bit_inside_a_record_starts_a_new_one():
    protocol = FlockOfBirds()
    assert [s.tracker for s in decode(protocol, [TWO_BIRDS[:9], TWO_BIRDS])] == ["1", "2"]
    assert protocol.counters.bytes_dropped == 9


def test_settings_and_missing_birds_are_named():
    with pytest.raises(SettingError, match="use 36, 72, 144"):
        FlockOfBirds(full_scale_in=48)
    with pytest.raises(DeviceError, match="bird at address 3 is not running"):
        Wire(FlockOfBirds().simulator(["a", "b"])).run(FlockOfBirds(birds=3).start())
    with pytest.raises(DeviceError, match="no answer from Ascension Flock"):
        Wire(FlockOfBirds().simulator(["a"]), bauds=()).run(FlockOfBirds().start())
