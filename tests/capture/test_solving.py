"""What is done to a take's frames before they are solved."""

import numpy as np
import pytest

from capture.solving import only_roles
from devices.errors import SettingError
from devices.frame import TrackerFrame
from devices.sample import ROLES

FRAME = TrackerFrame.from_positions(0.5, {role: np.full(3, float(i)) for i, role in enumerate(ROLES)})


def test_only_the_named_roles_are_left():
    (frame,) = only_roles([FRAME], "head, left_wrist")
    assert [role for role, there in zip(ROLES, frame.measured, strict=True) if there] == ["head", "left_wrist"]
    np.testing.assert_array_equal(frame.positions[1], FRAME.positions[1])
    assert frame.time_s == FRAME.time_s
    assert not frame.positions.flags.writeable


@pytest.mark.parametrize(("roles", "message"), [("hand,head", "left_wrist"), ("head", "at least two")])
def test_unknown_roles_and_too_few_are_refused(roles, message):
    with pytest.raises(SettingError, match=message):
        only_roles([FRAME], roles)
