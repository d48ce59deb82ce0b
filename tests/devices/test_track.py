"""A track gives a place only where neighbouring readings know it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from devices.frame import TrackerState
from devices.track import Track, slerp


def line(times: list[float], **settings: float) -> Track:
    """A tracker that is at (t, 2 t, 0) at time t."""
    track = Track(**settings)
    for t in times:
        assert track.push(t, (t, 2 * t, 0.0), None)
    return track


def test_between_neighbours_it_is_on_the_line():
    track = line([0.0, 0.1, 0.2])
    position, orientation, state = track.at(0.13)
    assert position == pytest.approx((0.13, 0.26, 0.0))
    assert (orientation, state) == (None, TrackerState.MEASURED)


def test_a_lost_reading_leaves_a_hole_but_for_its_neighbours_surroundings():
    track = line([0.0, 0.1, 0.2, 0.4, 0.5])
    assert track.at(0.3) is None
    assert track.at(0.22)[0] == pytest.approx((0.2, 0.4, 0.0))
    assert track.at(0.39)[0] == pytest.approx((0.4, 0.8, 0.0))
    assert track.at(-0.2) is None
    assert track.at(0.6) is None


def test_it_is_carried_on_for_as_long_as_told():
    track = line([0.0, 0.1, 0.2], extrapolate_s=0.1)
    position, _, state = track.at(0.27)
    assert position == pytest.approx((0.27, 0.54, 0.0))
    assert state == TrackerState.EXTRAPOLATED
    assert track.at(0.31) is None


def test_a_single_reading_is_not_carried_on():
    assert line([0.0], extrapolate_s=0.1).at(0.05) is None


def test_old_readings_are_refused():
    track = line([0.0, 0.1])
    assert not track.push(0.05, (7, 7, 7), None)
    assert track.at(0.05)[0] == pytest.approx((0.05, 0.1, 0.0))


def test_the_newest_of_one_batch_counts():
    track = line([0.0, 0.1])
    assert track.push(0.1, (5.0, 0.0, 0.0), None)
    assert track.at(0.1)[0] == (5.0, 0.0, 0.0)


def test_forgetting_changes_nothing_later():
    track, kept = line([0.1 * i for i in range(50)]), line([0.1 * i for i in range(50)])
    track.forget_before(2.03)
    for t in (2.03, 2.5, 4.9):
        assert track.at(t) == kept.at(t)
    assert len(track._times) < 35


unit = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(c * c for c in q) > 0.1)


@given(unit, unit, st.floats(0, 1))
def test_slerp_is_scipys(p, q, share):
    p, q = Rotation.from_quat(p), Rotation.from_quat(q)
    if (p.inv() * q).magnitude() > 3.1:
        return
    ours = Rotation.from_quat(slerp(tuple(p.as_quat()), tuple(q.as_quat()), share))
    theirs = Slerp([0, 1], Rotation.concatenate([p, q]))(share)
    assert (ours.inv() * theirs).magnitude() < 1e-6
