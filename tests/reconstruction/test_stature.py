"""Stature: found from the bones, and set."""

from dataclasses import replace

import numpy as np
import pytest

from devices.errors import SixpointError
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton
from reconstruction.stature import scaled_to_stature, stature


@pytest.mark.parametrize("height", [1.5, 1.75, 1.95])
def test_the_standard_body_is_as_tall_as_it_was_made(height):
    assert stature(standard_skeleton(height)) == pytest.approx(height)


def test_scaling_keeps_proportions_and_gives_the_stature():
    scaled = scaled_to_stature(standard_skeleton(1.75), 1.6)
    assert stature(scaled) == pytest.approx(1.6)
    np.testing.assert_allclose(scaled.offsets, standard_skeleton(1.6).offsets)


def test_where_a_file_puts_the_head_does_not_matter():
    body = standard_skeleton(1.75)
    low = body.offsets.copy()
    low[body.humanoid["neck"]] *= 0.5
    assert stature(replace(body, offsets=low)) == pytest.approx(1.75)


def test_without_legs_there_is_no_stature():
    with pytest.raises(SixpointError, match="no leg"):
        stature(Skeleton(("Hips",), np.array([-1], np.int32), np.zeros((1, 3))))
