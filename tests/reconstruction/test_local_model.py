import numpy as np

from reconstruction.local_model import LocalModelSettings, gather, local_prior

EXACT = LocalModelSettings(pose_floor=0.01, step_floor=0.01, pose_widening=1.0, step_widening=1.0)


def neighbours(seed: int, count: int = 12, dof: int = 8):
    rng = np.random.default_rng(seed)
    return rng.normal(0, 0.1, (count, dof)), rng.normal(0, 0.02, (count, dof)), np.full(count, 1 / count)


def test_without_history_it_is_the_neighbours_mean_and_covariance():
    following, steps, weights = neighbours(0)
    prior = local_prior(following, steps, weights, None, 1.0, EXACT)
    covariance = np.cov(following.T, bias=True) + 0.01**2 * np.eye(8)
    np.testing.assert_allclose(prior.mean, following.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(prior.precision @ covariance, np.eye(8), atol=1e-8)


def test_with_history_it_is_the_product_of_two_gaussians():
    following, steps, weights = neighbours(1)
    last = np.full(8, 0.3)
    pose = local_prior(following, steps, weights, None, 1.0, EXACT)
    both = local_prior(following, steps, weights, last, 1.0, EXACT)
    precision = np.diag(1 / (steps.var(axis=0) + 0.01**2))
    mean = np.linalg.solve(
        pose.precision + precision, pose.precision @ pose.mean + precision @ (last + steps.mean(axis=0))
    )
    np.testing.assert_allclose(both.precision, pose.precision + precision, rtol=1e-9)
    np.testing.assert_allclose(both.mean, mean, atol=1e-9)


def test_widening_makes_the_pose_count_less_and_the_history_more():
    following, steps, weights = neighbours(2)
    last = np.full(8, 0.3)
    near = local_prior(following, steps, weights, last, 1.0, EXACT)
    far = local_prior(following, steps, weights, last, 5.0, EXACT)
    expected = last + steps.mean(axis=0)
    assert np.linalg.norm(far.mean - expected) < np.linalg.norm(near.mean - expected)
    assert np.linalg.eigvalsh(near.precision - far.precision).min() > -1e-6


def test_the_gathering_kernel_agrees_with_coordinates_of_the_motion(database):
    rows = np.sort(database.windows)[[0, 40, 300, 700]].astype(np.int64)
    for row, seen in zip(rows, gather(rows, 2, np.asarray(database.poses), np.asarray(database.headings)), strict=True):
        clip = database.clip_of(int(row))
        motion, frame = database.motion(clip), database.headings[row - 1].astype(np.float64)
        at = slice(int(row) - 2 - clip.first, int(row) - 1 - clip.first)
        plain = database.space.coordinates(motion.root_positions[at], motion.rotations[at], frame)
        np.testing.assert_allclose(seen, plain[0], atol=1e-5)
