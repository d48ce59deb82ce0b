"""Who wears what is found from walking, whichever way the trackers are mixed up."""

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.assignment import find_assignment
from devices.errors import DeviceError
from devices.sample import ROLES, TrackerSample

SUBSETS = [ROLES, ROLES[1:], ROLES[2:], ("head", "left_wrist", "right_wrist"), ("left_ankle", "right_ankle")]


def walk(roles, order, heading: float, floor: float, seconds: float = 6.0, speed: float = 1.2):
    """Samples of someone who walks on a gentle curve; tracker "0" is on roles[order[0]], and so on."""
    samples = []
    for i in range(round(60 * seconds)):
        t = i / 60
        yaw = heading + 0.1 * t
        x, z = speed * t * math.sin(yaw), speed * t * math.cos(yaw)
        for tracker, which in enumerate(order):
            side, up, ahead = place(roles[which], math.pi * t / 0.5)
            left = (math.cos(yaw), -math.sin(yaw))
            front = (math.sin(yaw), math.cos(yaw))
            position = (x + side * left[0] + ahead * front[0], up + floor, z + side * left[1] + ahead * front[1])
            samples.append(TrackerSample(str(tracker), round(t * 1e9), position))
    return samples


def place(role: str, phase: float) -> tuple[float, float, float]:
    """(to the left, up, ahead) of the middle of the body."""
    sign = 1 if role.startswith("left") else -1
    if role == "root":
        return 0.0, 0.94 + 0.02 * math.cos(2 * phase), 0.0
    if role == "head":
        return 0.0, 1.58 + 0.02 * math.cos(2 * phase), 0.05
    if role.endswith("wrist"):
        return sign * 0.28, 0.85, 0.05 - 0.2 * sign * math.sin(phase)
    return sign * 0.1, 0.1 + 0.08 * max(0.0, sign * math.cos(phase)), 0.3 * sign * math.sin(phase)


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(SUBSETS), st.integers(0, 999), st.floats(-3.1, 3.1), st.floats(-0.2, 0.2))
def test_any_mixture_is_sorted_out(roles, seed, heading, floor):
    order = random.Random(seed).sample(range(len(roles)), len(roles))
    found = find_assignment(walk(roles, order, heading, floor), roles)
    assert found.roles == {str(tracker): roles[which] for tracker, which in enumerate(order)}
    assert found.walked
    assert found.certainty > 0.9


def test_four_limbs_are_known_for_what_they_are():
    found = find_assignment(walk(ROLES[2:], [2, 0, 3, 1], 0.5, 0.0))
    assert found.roles == {"0": "left_ankle", "1": "left_wrist", "2": "right_ankle", "3": "right_wrist"}


def test_without_walking_sides_are_guesses_and_it_says_so():
    found = find_assignment(walk(ROLES, range(6), 0.0, 0.0, speed=0.0))
    assert not found.walked
    assert found.certainty < 0.6
    assert (found.roles["0"], found.roles["1"]) == ("root", "head")
    assert {found.roles["4"], found.roles["5"]} == {"left_ankle", "right_ankle"}


def test_too_little_is_refused():
    with pytest.raises(DeviceError, match="no tracker"):
        find_assignment([])
    with pytest.raises(DeviceError, match="walk for 5 seconds"):
        find_assignment(walk(ROLES, range(6), 0.0, 0.0, seconds=1.0))
    with pytest.raises(DeviceError, match="6 trackers were seen, not the 4"):
        find_assignment(walk(ROLES, range(6), 0.0, 0.0), ROLES[2:])


def test_hidden_trackers_are_waited_for():
    samples = [s for s in walk(ROLES, range(6), 0.0, 0.0) if not (s.tracker == "3" and 1e9 < s.host_time_ns < 3e9)]
    found = find_assignment(samples)
    assert found.roles == {str(i): role for i, role in enumerate(ROLES)}
    assert np.isfinite(found.certainty)
