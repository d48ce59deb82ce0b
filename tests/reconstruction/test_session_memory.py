import numpy as np
import pytest

from devices.sample import ROLES
from reconstruction.session_memory import SessionMemory

LEFT_WRIST = ROLES.index("left_wrist")
LOST = np.arange(len(ROLES)) == LEFT_WRIST


def moment(phase: float, at=(0.0, 0.0, 0.0)) -> np.ndarray:
    """A body that swings its limbs, each in its own way."""
    limbs = np.arange(len(ROLES))[:, None] + np.arange(3)
    places = np.where(np.arange(len(ROLES))[:, None] < 2, 1.0, 0.3 * np.sin(phase + limbs)) + np.asarray(at)
    return np.stack((places, 0.05 * np.cos(phase + limbs)))


def walked(seconds: float, habit=0.0) -> SessionMemory:
    memory = SessionMemory()
    for number in range(int(60 * seconds)):
        seen = moment(2 * np.pi * number / 60)
        seen[0, LEFT_WRIST] += habit
        memory.add(seen)
    return memory


def test_a_lost_joint_is_where_it_was_when_the_others_were_where_they_are():
    now = moment(1.234)
    found = walked(2.0, habit=0.2).recall(np.where(LOST[:, None], np.nan, now), ~LOST, LOST)
    np.testing.assert_allclose(found.places[0], now[0, LEFT_WRIST] + 0.2, atol=0.02)
    assert found.sigma_m[0] < 0.02


def test_a_stranger_moment_is_remembered_with_less_certainty():
    memory = walked(2.0)
    known, strange = moment(1.0), moment(1.0)
    strange[:, ROLES.index("right_ankle")] += 0.5
    sure, unsure = (memory.recall(m, ~LOST, LOST).sigma_m[0] for m in (known, strange))
    assert unsure == pytest.approx(np.sqrt(2 * 3 * 0.5**2 / 5 / 3), rel=0.2)
    assert sure < unsure / 10


def test_joints_go_along_with_the_trunk():
    memory = walked(2.0)
    risen = memory.recall(moment(1.0, at=(0.0, 0.1, 0.0)), ~LOST, LOST)
    np.testing.assert_allclose(risen.places[0], moment(1.0)[0, LEFT_WRIST] + [0.0, 0.1, 0.0], atol=0.05)


def test_with_little_to_go_by_nothing_is_recalled():
    nobody = np.zeros(len(ROLES), np.bool_)
    assert len(walked(0.2).recall(moment(0.0), ~LOST, LOST).places) == 0
    assert len(walked(2.0).recall(moment(0.0), nobody, LOST).places) == 0


def test_the_oldest_moments_are_forgotten():
    memory = walked(1.0)
    for _ in range(SessionMemory.MOMENTS):
        memory.add(moment(0.0))
    assert len(memory) == SessionMemory.MOMENTS
    found = memory.recall(moment(3.0), ~LOST, LOST)
    np.testing.assert_allclose(found.places[0], moment(0.0)[0, LEFT_WRIST], atol=1e-9)
