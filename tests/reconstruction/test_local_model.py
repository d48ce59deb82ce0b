import numpy as np

from reconstruction.local_model import LocalModelSettings, gather, local_prior

EXACT = LocalModelSettings(pose_floor=0.01, step_floor=0.01, pose_widening=1.0, step_widening=1.0)
NOWHERE = np.full((8, 8), np.nan)
"""A covariance that may not be looked at."""


def neighbours(seed: int, count: int = 12, dof: int = 8):
    rng = np.random.default_rng(seed)
    return rng.normal(0, 0.1, (count, dof)), rng.normal(0, 0.02, (count, dof)), np.full(count, 1 / count)


def test_without_history_it_is_the_neighbours_mean_and_covariance():
    following, steps, weights = neighbours(0)
    prior = local_prior(following, steps, weights, None, 1.0, NOWHERE, EXACT)
    covariance = np.cov(following.T, bias=True) + 0.01**2 * np.eye(8)
    np.testing.assert_allclose(prior.mean, following.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(prior.precision @ covariance, np.eye(8), atol=1e-8)


def test_with_history_it_is_the_product_of_two_gaussians():
    following, steps, weights = neighbours(1)
    last = np.full(8, 0.3)
    pose = local_prior(following, steps, weights, None, 1.0, NOWHERE, EXACT)
    both = local_prior(following, steps, weights, last, 1.0, NOWHERE, EXACT)
    precision = np.diag(1 / (steps.var(axis=0) + 0.01**2))
    mean = np.linalg.solve(
        pose.precision + precision, pose.precision @ pose.mean + precision @ (last + steps.mean(axis=0))
    )
    np.testing.assert_allclose(both.precision, pose.precision + precision, rtol=1e-9)
    np.testing.assert_allclose(both.mean, mean, atol=1e-9)
    np.testing.assert_allclose(both.without_last.precision, pose.precision, atol=1e-9 * precision.max())


def test_far_neighbours_leave_the_pose_to_vary_as_all_poses_do():
    following, steps, weights = neighbours(2)
    everything = np.cov(np.random.default_rng(5).normal(0, 1, (40, 8)).T)
    far = local_prior(following, steps, weights, None, 3.0, everything, EXACT)
    covariance = np.cov(following.T, bias=True) + EXACT.background**2 * 8 * everything + 0.03**2 * np.eye(8)
    np.testing.assert_allclose(far.precision @ covariance, np.eye(8), atol=1e-8)


def test_far_neighbours_leave_the_step_freer():
    following, steps, weights = neighbours(3)
    last, everything = np.full(8, 0.3), np.zeros((8, 8))
    pose, both = (local_prior(following, steps, weights, at, 3.0, everything, EXACT) for at in (None, last))
    np.testing.assert_allclose(both.precision - pose.precision, np.diag(1 / (steps.var(axis=0) + 0.03**2)), rtol=1e-6)


def test_the_gathering_kernel_agrees_with_coordinates_of_the_motion(database):
    rows = np.sort(database.windows)[[0, 40, 300, 700]].astype(np.int64)
    for row, seen in zip(rows, gather(rows, 2, np.asarray(database.poses), np.asarray(database.headings)), strict=True):
        clip = database.clip_of(int(row))
        motion, frame = database.motion(clip), database.headings[row - 1].astype(np.float64)
        at = slice(int(row) - 2 - clip.first, int(row) - 1 - clip.first)
        plain = database.space.coordinates(motion.root_positions[at], motion.rotations[at], frame)
        np.testing.assert_allclose(seen, plain[0], atol=1e-5)
