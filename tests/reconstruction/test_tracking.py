import numpy as np
import pytest

from devices.frame import TrackerFrame, TrackerState, frozen
from devices.sample import ROLES
from reconstruction.motion import Pose
from reconstruction.rotations import about_up
from reconstruction.tracking import Footing, NoiseMeter, PoseEasing, TrackerReturn, footings


def frame(number: int, x: float = 0.0, lost: bool = False) -> TrackerFrame:
    seen = {} if lost else {role: (x, 1.0, 0.0) for role in ROLES}
    return TrackerFrame.from_positions(number / 60, seen)


def test_a_tracker_comes_back_from_where_it_was_believed_to_be():
    back = TrackerReturn()
    expected = np.tile([0.1, 1.0, 0.0], (6, 1))
    for number in range(10):
        np.testing.assert_array_equal(back.eased(frame(number), None)[:, 0], 0)
    for number in range(10, 40):
        assert np.isnan(back.eased(frame(number, lost=True), expected)).all()
    way = np.array([back.eased(frame(40 + n), expected)[2, 0] for n in range(30)])
    assert way[0] == pytest.approx(0.1)
    assert way[-1] == 0
    assert np.abs(np.diff(way, 2)).max() < 0.1 / 18**2 * 6.5
    assert (np.diff(way) <= 1e-12).all()


def test_a_tracker_comes_back_with_the_velocity_it_was_believed_to_have():
    back, speed = TrackerReturn(), 0.02
    believed = [np.tile([speed * n, 1.0, 0.0], (6, 1)) for n in range(80)]
    for number in range(20):
        back.eased(frame(number, lost=number > 0), believed[number])
    way = [speed * 19]
    for number in range(20, 50):
        going_on = 2 * way[-1] - way[-2] if len(way) > 1 else speed * number
        way.append(back.eased(frame(number), np.tile([going_on, 1.0, 0.0], (6, 1)))[2, 0])
    assert way[-1] == 0
    assert np.abs(np.diff(way, 2)).max() < 0.8 * speed
    np.testing.assert_allclose(np.diff(way, 2)[:1], 0, atol=0.15 * speed)


def test_short_gaps_are_no_dropouts():
    back = TrackerReturn()
    back.eased(frame(0), None)
    np.testing.assert_array_equal(back.eased(frame(1, 0.5), np.zeros((6, 3)))[:, 0], 0.5)


@pytest.mark.parametrize("sigma", [0.001, 0.004])
def test_noise_is_estimated_through_movement(sigma):
    rng = np.random.default_rng(3)
    meter = NoiseMeter()
    for n in range(120):
        centre = np.array([1.2 * n / 60, 1 + 0.1 * np.sin(n / 8), 0.2 * np.cos(n / 10)])
        meter.add(TrackerFrame.from_positions(n / 60, {role: centre + rng.normal(0, sigma, 3) for role in ROLES}))
    assert meter.sigma_m == pytest.approx(sigma, rel=0.25)


def test_without_noise_none_is_seen():
    meter = NoiseMeter()
    assert meter.sigma_m == 0
    for n in range(120):
        meter.add(frame(n, x=0.3 * np.sin(n / 10)))
    assert meter.sigma_m < 1e-4


def test_a_change_of_mind_is_shown_without_a_jump():
    easing = PoseEasing()

    def pose(number: int, x: float, yaw: float) -> Pose:
        return Pose(number / 60, np.array([x, 1.0, 0.0]), about_up(np.array([yaw]))[None].reshape(1, 4))

    for number in range(5):
        assert easing.eased(pose(number, 0.0, 0.0)).root_position[0] == 0
    easing.begin()
    way = np.array([easing.eased(pose(5 + n, 0.4, 1.0)).root_position[0] for n in range(40)])
    assert way[0] < 0.01
    assert way[-1] == 0.4
    assert np.diff(way).max() < 0.4 / 30 * 2.2


def test_footings_name_what_each_role_stands_on():
    some = TrackerFrame.from_positions(0.0, {"head": (0.0, 1.7, 0.0), "root": (0.0, 1.0, 0.0)})
    states = some.states.copy()
    states[0] = TrackerState.EXTRAPOLATED
    mixed = TrackerFrame(0.0, some.positions, some.orientations, frozen(states))
    found = footings(mixed, held=False)
    assert found.tolist() == [Footing.EXTRAPOLATED, Footing.MEASURED] + 4 * [Footing.PRIOR]
    assert footings(frame(0, lost=True), held=True).tolist() == 6 * [Footing.HELD]
