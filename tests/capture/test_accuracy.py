from dataclasses import replace

import numpy as np
import pytest

from capture.accuracy import accuracy, counted_joints
from devices.errors import SettingError
from reconstruction.motion import Motion
from reconstruction.motion_operations import cropped
from reconstruction.rotations import exponential, multiply
from tests.reconstruction.moving_bodies import walking


@pytest.fixture
def truth() -> Motion:
    return walking(90)


def test_the_truth_is_without_error(truth: Motion) -> None:
    found = accuracy(truth, truth)
    assert found.euler_deg == pytest.approx(0, abs=1e-9)
    assert found.geodesic_deg == pytest.approx(0, abs=1e-5)
    assert found.mpjpe_cm == found.tracked_cm == 0
    assert found.jitter_ratio == 1


def test_a_shift_is_that_many_centimetres_and_no_degrees(truth: Motion) -> None:
    shifted = replace(truth, root_positions=truth.root_positions + np.array([0.03, 0, 0.04]))
    found = accuracy(truth, shifted)
    assert found.mpjpe_cm == pytest.approx(5)
    assert found.tracked_cm == pytest.approx(5)
    assert found.euler_deg == pytest.approx(0, abs=1e-9)
    assert found.jitter_ratio == pytest.approx(1)


def test_a_turned_joint_counts_once_among_all(truth: Motion) -> None:
    rotations = truth.rotations.copy()
    head = truth.skeleton.names.index("Head")
    rotations[:, head] = multiply(rotations[:, head], exponential(np.radians([0.0, 0.0, 6.0])))
    found = accuracy(truth, replace(truth, rotations=rotations))
    joints = len(counted_joints(truth.skeleton))
    assert found.geodesic_deg == pytest.approx(6 / joints)
    assert found.euler_deg == pytest.approx(6 / (3 * joints))
    assert found.mpjpe_cm == pytest.approx(0, abs=1e-9)


def test_end_sites_are_not_counted(truth: Motion) -> None:
    assert not truth.skeleton.is_end[counted_joints(truth.skeleton)].any()


def test_motions_that_cannot_be_compared_are_refused(truth: Motion) -> None:
    with pytest.raises(SettingError, match="90 frames"):
        accuracy(truth, cropped(truth, 0, 50))
