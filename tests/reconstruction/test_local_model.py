import numpy as np

from reconstruction.limb_poses import Statement
from reconstruction.local_model import LocalModelSettings, local_prior

EXACT = LocalModelSettings(pose_floor=0.01, step_floor=0.01, pose_widening=1.0, step_widening=1.0, trust=1.0)
NOWHERE = np.full((8, 8), np.nan)
"""A covariance that may not be looked at."""
SOMEWHERE = np.cov(np.random.default_rng(5).normal(0, 1, (40, 8)).T)


def neighbours(seed: int, count: int = 12, dof: int = 8):
    rng = np.random.default_rng(seed)
    return rng.normal(0, 0.1, (count, dof)), rng.normal(0, 0.02, (count, dof)), np.full(count, 1 / count)


def test_without_history_it_is_the_neighbours_mean_and_covariance():
    following, steps, weights = neighbours(0)
    prior = local_prior(following, steps, weights, None, 1.0, NOWHERE, None, 6, EXACT)
    covariance = np.cov(following.T, bias=True) + 0.01**2 * np.eye(8)
    np.testing.assert_allclose(prior.mean, following.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(prior.precision @ covariance, np.eye(8), atol=1e-8)


def test_with_history_it_is_the_product_of_two_gaussians():
    following, steps, weights = neighbours(1)
    last = np.full(8, 0.3)
    pose = local_prior(following, steps, weights, None, 1.0, NOWHERE, None, 6, EXACT)
    both = local_prior(following, steps, weights, last, 1.0, NOWHERE, None, 6, EXACT)
    precision = np.diag(1 / (steps.var(axis=0) + 0.01**2))
    mean = np.linalg.solve(
        pose.precision + precision, pose.precision @ pose.mean + precision @ (last + steps.mean(axis=0))
    )
    np.testing.assert_allclose(both.precision, pose.precision + precision, rtol=1e-9)
    np.testing.assert_allclose(both.mean, mean, atol=1e-9)
    np.testing.assert_allclose(both.without_last.precision, pose.precision, atol=1e-9 * precision.max())
    np.testing.assert_allclose(both.without_last.mean, pose.mean, atol=1e-7)


def test_far_neighbours_leave_the_pose_to_vary_as_all_poses_do():
    following, steps, weights = neighbours(2)
    far = local_prior(following, steps, weights, None, 2.0, SOMEWHERE, None, 6, EXACT)
    covariance = np.cov(following.T, bias=True) + EXACT.background**2 * 3 * SOMEWHERE + 0.02**2 * np.eye(8)
    np.testing.assert_allclose(far.precision @ covariance, np.eye(8), atol=1e-8)


def test_far_neighbours_leave_the_step_freer():
    following, steps, weights = neighbours(3)
    last = np.full(8, 0.3)
    pose, both = (local_prior(following, steps, weights, at, 3.0, SOMEWHERE, None, 6, EXACT) for at in (None, last))
    np.testing.assert_allclose(both.precision - pose.precision, np.diag(1 / (steps.var(axis=0) + 0.03**2)), rtol=1e-6)


def test_in_doubt_a_third_gaussian_is_multiplied_in():
    following, steps, weights = neighbours(4)
    limbs, last = Statement(np.diag(np.arange(8.0)), np.arange(8.0) * 2.0), np.full(8, 2.0)
    near, far = (local_prior(following, steps, weights, last, 4.0, SOMEWHERE, s, 6, EXACT) for s in (None, limbs))
    np.testing.assert_allclose(far.precision, near.precision + limbs.precision, rtol=1e-12)
    np.testing.assert_allclose(far.precision @ far.mean, near.precision @ near.mean + limbs.information, rtol=1e-6)


def test_the_fewer_the_trackers_the_more_the_neighbours_pose_counts():
    following, steps, weights = neighbours(6)
    settings = LocalModelSettings(trust=0.5, few_trust=1.0)
    six, two = (local_prior(following, steps, weights, None, 1.0, NOWHERE, None, n, settings) for n in (6, 2))
    np.testing.assert_allclose(two.precision, 3 * six.precision, rtol=1e-12)
    np.testing.assert_allclose(two.mean, six.mean, atol=1e-9)
    assert settings.trusted(6) == 0.5
    assert settings.trusted(0) == settings.trusted(1)


def test_the_third_statement_sets_in_gradually():
    settings = LocalModelSettings(doubt_from=2.0, doubt_full=4.0, later=1.0)
    here, gone = zip(*(settings.doubt(widening) for widening in (1.0, 2.0, 3.0, 4.0, 9.0)), strict=True)
    assert here == (0.0, 0.0, 0.5, 1.0, 1.0)
    assert gone == (0.0, 0.0, 0.0, 0.5, 1.0)
