import numpy as np
import pytest

from capture.colour import linear, srgb_bytes


def test_linear_light_is_the_standard_curve():
    assert linear([0.0, 1.0]).tolist() == [0.0, 1.0]
    assert linear(0.5) == pytest.approx(0.2140, abs=1e-4)


def test_bytes_come_back_from_linear_light():
    codes = np.arange(256)
    assert np.array_equal(srgb_bytes(linear(codes / 255).astype(np.float32)), codes)
    assert srgb_bytes(np.array([-1.0, 3.0])).tolist() == [0, 255]
