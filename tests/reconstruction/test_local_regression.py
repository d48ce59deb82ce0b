import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.local_regression import history_weights, regress


def example(seed: int, neighbours: int = 20, inputs: int = 9, outputs: int = 4):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(0, 0.3, (neighbours, inputs)), rng.normal(0, 0.3, (neighbours, outputs))
    return x, y, rng.normal(0, 0.3, inputs)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000))
def test_agrees_with_eigenvectors_taken_one_output_at_a_time(seed):
    x, y, query = example(seed)
    w = history_weights(x, query)
    found = regress(x, y, w, query)
    mean_x, weight = w @ x, np.diag(w)
    for d in range(y.shape[1]):
        xc, yc = x - mean_x, y[:, d] - w @ y[:, d]
        cross = xc.T @ weight @ yc
        u = np.linalg.eigh(np.outer(cross, cross))[1][:, -1:]
        a = u @ np.linalg.inv(u.T @ xc.T @ weight @ xc @ u) @ u.T @ xc.T @ weight @ yc  # eq. 9
        np.testing.assert_allclose(found.mean[d], w @ y[:, d] + a @ (query - mean_x), atol=1e-9)
        np.testing.assert_allclose(found.deviation[d] ** 2, w @ (yc - xc @ a) ** 2, atol=1e-9)


def test_recovers_a_relation_along_one_direction_and_says_it_is_sure():
    rng = np.random.default_rng(0)
    direction = rng.normal(size=9)
    along = rng.normal(size=30)
    x = along[:, None] * direction
    found = regress(x, np.stack((2 * along, 0 * along + 1), axis=1), np.full(30, 1 / 30), 1.5 * direction)
    np.testing.assert_allclose(found.mean, [3.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(found.deviation, 0, atol=1e-9)


def test_weights_fall_with_distance_and_survive_far_queries():
    x = np.array([[0.0], [1.0], [2.0]])
    near = history_weights(x, np.array([0.0]))
    np.testing.assert_allclose(near / near[0], np.exp([0, -0.5, -2.0]))
    far = history_weights(x, np.array([1000.0]))
    assert far[2] == 1.0
    assert np.isfinite(far).all()
