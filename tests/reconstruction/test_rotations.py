import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from reconstruction import rotations as r

vectors = arrays(np.float64, (4, 3), elements=st.floats(-1.7, 1.7))


@given(vectors)
def test_exponential_and_logarithm_are_inverse(w):
    np.testing.assert_allclose(r.logarithm(r.exponential(w)), w, atol=1e-9)


@given(vectors, vectors)
def test_products_and_rotations_agree_with_scipy(a, b):
    p, q = r.exponential(a), r.exponential(b)
    product = Rotation.from_rotvec(a) * Rotation.from_rotvec(b)
    np.testing.assert_allclose(Rotation.from_quat(r.multiply(p, q)).as_matrix(), product.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(r.rotate(p, b), Rotation.from_rotvec(a).apply(b), atol=1e-12)
    np.testing.assert_allclose(r.multiply(p, r.inverse(p)), np.tile([0, 0, 0, 1.0], (4, 1)), atol=1e-12)


@given(st.floats(-3.1, 3.1), arrays(np.float64, 2, elements=st.floats(-1, 1)))
def test_twist_about_up_is_what_was_turned(yaw, tilt):
    swing = r.exponential(np.array([tilt[0], 0.0, tilt[1]]))
    assert abs(r.wrapped(r.twist_about_up(r.multiply(r.about_up(yaw), swing)) - yaw)) < 1e-9


def test_mean_of_rotations_about_one_axis():
    angles = np.array([0.1, 0.2, 0.6])
    w = np.zeros((3, 2, 3))
    w[:, 0, 0], w[:, 1, 1] = angles, -angles
    mean = r.logarithm(r.mean_of_sum(r.outer_sum(r.exponential(w))))
    middle = np.angle(np.exp(1j * angles / 2).mean()) * 2
    np.testing.assert_allclose(mean, [[middle, 0, 0], [0, -middle, 0]], atol=2e-3)


def test_near_the_identity_nothing_is_lost():
    w = np.full((1, 3), 1e-12)
    np.testing.assert_allclose(r.logarithm(r.exponential(w)), w, rtol=1e-9)
