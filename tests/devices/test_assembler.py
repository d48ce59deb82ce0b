"""Frames come at the solver's rate, no earlier than their latency, from readings in any order of roles."""

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.assembler import FrameAssembler
from devices.errors import SettingError
from devices.frame import TrackerState
from devices.intake import DeviceIntake, RoleReading
from devices.room import RoomTransform
from devices.sample import ROLES, SampleFlag, TrackerSample

MS = 1_000_000


def reading(role: str, time_ms: float, x: float = 0.0) -> RoleReading:
    return RoleReading(ROLES.index(role), round(time_ms * MS), (x, 1.0, 0.0), None)


def test_frames_wait_for_their_latency_and_no_longer():
    assembler = FrameAssembler(rate_hz=100, latency_s=0.02)
    assembler.push([reading("head", t, t) for t in range(0, 100, 5)])
    assert assembler.frames(19 * MS) == []
    frames = assembler.frames(40 * MS)
    assert [round(f.time_s, 6) for f in frames] == [0.0, 0.01, 0.02]
    assert [f.positions[ROLES.index("head"), 0] for f in frames] == pytest.approx([0, 10, 20])


def test_roles_of_two_devices_meet_in_one_frame_whatever_their_order_and_phase():
    assembler = FrameAssembler(rate_hz=50, latency_s=0.02)
    head = [reading("head", t, t) for t in range(0, 200, 10)]
    wrist = [reading("left_wrist", t + 3.7, t + 3.7) for t in range(0, 200, 8)]
    assembler.push(head[:1])
    mixed = head[1:] + wrist
    order = sorted(range(len(mixed)), key=lambda i: (mixed[i].host_time_ns // (30 * MS), mixed[i].role))
    assembler.push(mixed[i] for i in order)
    for frame in assembler.frames(170 * MS)[1:]:
        for role in ("head", "left_wrist"):
            assert frame.positions[ROLES.index(role), 0] == pytest.approx(1000 * frame.time_s)
        assert np.isnan(frame.positions[ROLES.index("root")]).all()
        assert frame.states[ROLES.index("root")] == TrackerState.MISSING


def test_a_late_reading_is_bridged_and_then_missed():
    assembler = FrameAssembler(rate_hz=100, latency_s=0.0, extrapolate_s=0.025)
    assembler.push([reading("head", t, t) for t in range(0, 110, 10)])
    states = [f.states[1] for f in assembler.frames(160 * MS)]
    assert states[10] == TrackerState.MEASURED
    assert states[11:13] == [TrackerState.EXTRAPOLATED] * 2
    assert states[13:] == [TrackerState.MISSING] * 4


@given(st.lists(st.floats(4, 30), min_size=1, max_size=4), st.integers(0, 2**32))
def test_a_complete_frame_is_the_one_that_waiting_gives(periods_ms, seed):
    rng = random.Random(seed)
    phases = [rng.random() * period for period in periods_ms]
    readings = sorted(
        (
            reading(role, phase + i * period, rng.random())
            for role, period, phase in zip(ROLES, periods_ms, phases, strict=False)
            for i in range(round(1000 / period))
        ),
        key=lambda r: r.host_time_ns,
    )
    eager, patient = FrameAssembler(60, 0.1), FrameAssembler(60, 0.1)
    at_once, waited = [], []
    for each in readings:
        eager.push([each])
        at_once += eager.complete()
        at_once += eager.frames(each.host_time_ns)
        patient.push([each])
        waited += patient.frames(each.host_time_ns)
    waited += patient.frames(readings[-1].host_time_ns + 100 * MS)
    assert len(at_once) > 45
    for early, late in zip(at_once, waited, strict=False):
        assert early.time_s == late.time_s
        np.testing.assert_array_equal(early.positions, late.positions)
        np.testing.assert_array_equal(early.states, late.states)


def test_a_frame_is_complete_with_the_last_reading_that_it_needs():
    assembler = FrameAssembler(100, 0.05)
    assembler.push([reading(role, t) for t in range(0, 310, 10) for role in ("head", "root")])
    assert len(assembler.complete()) == 31
    assembler.push([reading("head", 310)])
    assert assembler.complete() == []
    assembler.push([reading("root", 311)])
    assert [round(f.time_s, 3) for f in assembler.complete()] == [0.31]
    assert assembler.frames(500 * MS)[0].time_s == pytest.approx(0.32)


def test_a_role_that_is_lost_is_waited_for_and_then_not_any_more():
    assembler = FrameAssembler(100, 0.05)
    assembler.push([reading(role, t) for t in range(0, 310, 10) for role in ("head", "root")])
    assembler.complete()
    made = []
    for t in range(310, 700, 10):
        assembler.push([reading("head", t)])
        made.append(len(assembler.complete()))
    assert made[:25] == [0] * 25
    assert sum(made) == 39
    assert made[-1] == 1


@given(st.integers(0, 2**32))
def test_the_splits_of_pushing_do_not_matter(seed):
    rng = random.Random(seed)
    readings = [reading(rng.choice(ROLES), 4 * i + rng.random(), rng.random()) for i in range(60)]
    whole = FrameAssembler(60, 0.05)
    whole.push(readings)
    at_once = whole.frames(240 * MS)
    pieces = FrameAssembler(60, 0.05)
    bit_by_bit = []
    for r in readings:
        pieces.push([r])
        if rng.random() < 0.3:
            # Only what can no longer change: readings of the next 50 ms are still to come.
            bit_by_bit += pieces.frames(r.host_time_ns - 200 * MS)
    bit_by_bit += pieces.frames(240 * MS)
    assert [f.time_s for f in bit_by_bit] == [f.time_s for f in at_once]


def test_memory_stays_flat():
    assembler = FrameAssembler(60)
    for i in range(20_000):
        assembler.push([reading("head", 2 * i)])
        assembler.frames(2 * i * MS)
    assert len(assembler._tracks[1]._times) < 40


def test_frames_are_read_only_and_time_counts_from_the_epoch():
    assembler = FrameAssembler(60, 0.0, epoch_ns=-1000 * MS)
    assembler.push([reading("head", 0)])
    frame = assembler.frames(0)[0]
    assert frame.time_s == pytest.approx(1.0)
    with pytest.raises(ValueError, match="read-only"):
        frame.positions[0] = 0


def test_settings_out_of_range_are_refused():
    with pytest.raises(SettingError):
        FrameAssembler(rate_hz=0)


def test_intake_keeps_measured_samples_of_assigned_trackers_and_moves_them_into_the_room():
    room = RoomTransform.turned(90, (1.0, 0.0, 0.0))
    intake = DeviceIntake({"1": "head"}, room)
    place, turn = (0.0, 1.0, 2.0), (0.0, 0.0, 0.0, 1.0)
    samples = [
        TrackerSample("1", 5, place, turn),
        TrackerSample("2", 5, place),
        TrackerSample("1", 6, None),
        TrackerSample("1", 7, place, flags=SampleFlag.HELD),
    ]
    (found,) = intake.readings(samples)
    assert (found.role, found.host_time_ns) == (ROLES.index("head"), 5)
    assert found.position == pytest.approx((3.0, 1.0, 0.0))
    assert found.orientation == pytest.approx((0, 0.5**0.5, 0, 0.5**0.5))


def test_an_unknown_role_is_named():
    with pytest.raises(SettingError, match=r"hand.*left_wrist"):
        DeviceIntake({"1": "hand"})
