"""Axes are relabelled exactly, for all 24 right-handed frames."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from devices.axes import RIGHT_HANDED, Axes
from devices.errors import SettingError


def matrix(axes: Axes) -> np.ndarray:
    return np.array([axes.to_rub((1, 0, 0)), axes.to_rub((0, 1, 0)), axes.to_rub((0, 0, 1))]).T


def test_there_are_24_frames_and_each_is_a_rotation():
    assert len(set(RIGHT_HANDED)) == 24
    for letters in RIGHT_HANDED:
        assert np.linalg.det(matrix(Axes(letters))) == pytest.approx(1)


def test_named_frames():
    assert Axes("RUB").to_rub((1, 2, 3)) == (1, 2, 3)
    assert Axes("FRD").to_rub((1, 2, 3)) == (2, -3, -1)
    assert Axes("FLU").to_rub((1, 2, 3)) == (-2, 3, -1)


@pytest.mark.parametrize("letters", RIGHT_HANDED)
def test_quaternions_turn_with_their_axes(letters):
    axes = Axes(letters)
    device = Rotation.from_rotvec([0.3, -0.5, 0.9])
    world = Rotation.from_quat(axes.quaternion_to_rub(tuple(device.as_quat())))
    v = (0.2, -0.7, 0.4)
    assert world.apply(axes.to_rub(v)) == pytest.approx(axes.to_rub(tuple(device.apply(v))))
    assert axes.from_rub(axes.to_rub(v)) == pytest.approx(v)
    assert axes.quaternion_from_rub(tuple(world.as_quat())) == pytest.approx(tuple(device.as_quat()))


@pytest.mark.parametrize("letters", ["RUF", "RRU", "XYZ", "", "rub"])
def test_other_letters_are_refused_with_the_valid_ones(letters):
    with pytest.raises(SettingError, match="RUB"):
        Axes(letters)
