import numpy as np

from reconstruction.pose_statistics import PoseStatistics


def test_poses_of_the_data_are_as_plausible_as_their_number_of_angles_says():
    poses = np.random.default_rng(0).normal(0, 0.5, (4000, 9)) @ np.random.default_rng(1).normal(0, 1, (9, 9))
    statistics = PoseStatistics.of(poses)
    mean = np.mean([statistics.implausibility(q) for q in poses])
    assert 0.9 < mean / (0.5 * 6) <= 1.0


def test_where_the_root_stands_changes_nothing():
    statistics = PoseStatistics.of(np.random.default_rng(2).normal(0, 0.5, (50, 9)))
    q = np.linspace(-1, 1, 9)
    moved = q + np.array([5.0, 1.0, -3.0, 0, 0, 0, 0, 0, 0])
    assert statistics.implausibility(moved) == statistics.implausibility(q)


def test_a_database_speaks_of_its_own_poses(database):
    statistics = PoseStatistics.of_database(database, 1.0)
    q = np.asarray(database.poses[100:2000:50], np.float64)
    twisted = q + np.where(np.arange(q.shape[1]) < 6, 0.0, 0.8)
    own, other = (np.median([statistics.implausibility(x) for x in poses]) for poses in (q, twisted))
    assert own < q.shape[1] < other / 2
