from dataclasses import replace

import numpy as np
import pytest

from capture.accuracy import accuracy, counted_joints, share_within_sigma
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


def test_a_foot_that_drifts_while_it_stands_slides(truth: Motion) -> None:
    still = replace(
        truth, root_positions=truth.root_positions[:1].repeat(90, 0), rotations=truth.rotations[:1].repeat(90, 0)
    )
    drift = np.arange(90)[:, None] / truth.fps * np.array([0.03, 0, 0.04])
    found = accuracy(still, replace(still, root_positions=still.root_positions + drift))
    assert found.slide_cm_s == pytest.approx(5)
    assert found.true_slide_cm_s == pytest.approx(0, abs=1e-9)


def test_a_foot_in_the_air_does_not_slide(truth: Motion) -> None:
    running = replace(truth, root_positions=truth.root_positions + np.arange(90)[:, None] * np.array([0.0, 0, 0.1]))
    assert accuracy(running, running).slide_cm_s == 0


def test_the_share_within_sigma_counts_joints_that_turn(truth: Motion) -> None:
    rotations = truth.rotations.copy()
    head, joints = truth.skeleton.names.index("Head"), counted_joints(truth.skeleton)
    rotations[:, head] = multiply(rotations[:, head], exponential(np.radians([0.0, 0.0, 6.0])))
    sigma = np.full((len(truth), len(truth.skeleton)), np.radians(5.0))
    sigma[:, joints[0]] = 0
    share = share_within_sigma(truth, replace(truth, rotations=rotations), sigma)
    assert share == pytest.approx(1 - 1 / (len(joints) - 1))
    assert share_within_sigma(truth, replace(truth, rotations=rotations), 1.3 * sigma) == 1
