import numpy as np
import pytest

from devices.sample import ROLES
from reconstruction.calibration import calibrate
from reconstruction.calibration_verdict import Grade
from reconstruction.mounting import Mounting
from tests.reconstruction.conftest import strolling
from tests.reconstruction.test_effectors import frames_of, readings

COUNT = 600
SLIP = np.array([0.06, -0.06, 0.05])


def worn(role: str | None, seed: int):
    """Frames of a stroll, noise and all, in whose middle the role's tracker moves by about 10 cm on its limb."""
    motion = strolling(seed, COUNT)
    before = readings(motion, Mounting.at_the_joints())[0]
    offsets = np.zeros((6, 3))
    if role is not None:
        offsets[ROLES.index(role)] = SLIP
    where, turned = readings(motion, Mounting(offsets, Mounting.at_the_joints().rotations))
    where[: COUNT // 2] = before[: COUNT // 2]
    where += np.random.default_rng(seed).normal(0, 0.001, where.shape)
    return frames_of(where, np.full_like(turned, np.nan))


@pytest.mark.parametrize(
    ("role", "words"), [("left_wrist", "left wrist's"), ("head", "head's"), ("right_ankle", "right ankle's")]
)
def test_a_tracker_that_slips_is_named_with_its_time(database, role, words):
    result = calibrate(worn(role, 70), database)
    assert result.grade is Grade.POOR
    assert f"the {words} tracker moved" in result.verdict


@pytest.mark.parametrize("seed", [70, 71, 72])
def test_a_tracker_that_stays_is_not_blamed(database, seed):
    result = calibrate(worn(None, seed), database)
    assert "strap" not in "".join((result.verdict, *result.advice))
