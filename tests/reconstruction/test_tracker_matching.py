from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import minimize

from reconstruction.tracker_matching import FACINGS, Sighting, TrackerMatcher, best_by_direction, planar_fit
from reconstruction.window_features import seen_from

OFFSETS = np.array([0, -5, -12])


def sighting(matcher: TrackerMatcher, row: int, heading: np.ndarray, noise: float = 0.0) -> Sighting:
    """What trackers would have read of a row's clip, standing at `heading`; one role is missing."""
    way = matcher.trajectory(row, OFFSETS)
    points = seen_from(way, np.tile(heading, (3, 1)), np.zeros((3, 3)))
    points += np.random.default_rng(0).normal(0, noise, points.shape)
    points[:, 1] = np.nan
    return Sighting(OFFSETS, points)


@pytest.fixture(scope="module")
def matcher(database):
    return TrackerMatcher(database)


def test_finds_the_row_and_where_it_stands(matcher):
    heading = np.array([2.0, -1.0, 2.5])
    found = matcher.best(sighting(matcher, 400, heading), np.arange(len(matcher)), 5)
    assert found.rows[0] == 400
    assert found.errors[0] < 1e-3
    np.testing.assert_allclose(found.heading, heading, atol=1e-3)


def test_the_best_of_all_is_found_from_every_so_many_th_row(matcher, monkeypatch):
    monkeypatch.setattr(TrackerMatcher, "LOOKED_AT", 200)
    found = matcher.best_of_all(sighting(matcher, 403, np.array([2.0, -1.0, 2.5])))
    assert found.rows.tolist() == [403]
    assert not len(matcher.best_of_all(Sighting(np.array([0, -10_000]), np.zeros((2, 6, 3)))).rows)


def test_rows_around_others_stay_inside(matcher):
    assert matcher.around(np.array([1, 3, len(matcher) - 1]), 2).tolist() == [
        *range(6),
        *range(len(matcher) - 3, len(matcher)),
    ]


def test_the_kernel_agrees_with_plain_minimisation(matcher):
    asked = sighting(matcher, 400, np.array([1.0, 1.0, 0.5]), noise=0.05)
    there = np.isfinite(asked.points[..., 0])
    rows = np.array([410, 777])
    for row, square in zip(rows, matcher.squares(asked, rows), strict=True):
        way = matcher.trajectory(int(row), OFFSETS)

        def total(heading, way=way):
            moved = seen_from(way, np.tile(heading, (3, 1)), np.zeros((3, 3)))
            return float(np.sum((moved - asked.points)[there] ** 2))

        best = min(minimize(total, [0, 0, yaw], tol=1e-10).fun for yaw in (0, 2, 4))
        assert square == pytest.approx(best, rel=1e-4)
        fit = planar_fit(way[there], asked.points[there])
        assert matcher.fits(asked, np.array([row]))[1, 0] == pytest.approx(fit[2], abs=1e-9)
        assert total(fit) == pytest.approx(best, rel=1e-4)
        assert matcher.error(asked, rows[rows == row], fit) == pytest.approx(np.sqrt(best / there.sum()), rel=1e-3)


def test_moments_outside_a_clip_do_not_count(matcher, database):
    asked = sighting(matcher, 400, np.zeros(3))
    first = database.clips[3].first
    assert np.isinf(matcher.squares(asked, np.arange(first, first + 12))).all()
    assert np.isfinite(matcher.squares(asked, np.array([first + 12]))).all()
    assert np.isnan(matcher.error(asked, np.array([first]), np.zeros(3)))


def test_each_direction_has_its_best():
    rng = np.random.default_rng(3)
    squares, yaw = rng.uniform(0, 1, 500), rng.uniform(-np.pi, np.pi, 500)
    squares[::7] = np.inf
    sector = np.floor(np.mod(yaw, 2 * np.pi) / (2 * np.pi / FACINGS))
    plain = [np.flatnonzero(sector == s)[np.argmin(squares[sector == s])] for s in range(FACINGS)]
    assert best_by_direction(squares, yaw).tolist() == sorted(plain, key=lambda place: squares[place])


def test_the_best_by_facing_face_every_way_they_can(matcher):
    heading = np.array([2.0, -1.0, 2.5])
    found = matcher.best_by_facing(sighting(matcher, 400, heading))
    assert found[0].rows[0] == 400
    assert len({int(np.mod(m.heading[2], 2 * np.pi) // (2 * np.pi / FACINGS)) for m in found}) == len(found) > 1
    assert all(a.errors[0] <= b.errors[0] for a, b in pairwise(found))
