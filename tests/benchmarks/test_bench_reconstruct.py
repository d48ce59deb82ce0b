import pytest

from capture.bench_reconstruct import BenchPlan, bench_reconstruct, growth
from reconstruction.database import build_database
from tests.reconstruction.conftest import database, strolling  # noqa: F401 - a fixture


@pytest.fixture(scope="module")
def figures(database):  # noqa: F811
    return bench_reconstruct(database, BenchPlan(frames=240, clip_frames=60, methods=("default", "paper", "damped-ik")))


def test_measures_every_stage_and_agrees_with_least_squares(figures):
    assert set(figures["default"]["stages_ms"]) >= {"prior", "map", "rest"}
    assert {"default", "paper", "damped-ik"} < set(figures)
    assert abs(figures["map problem"]["energy_above_least_squares"]["max"]) < 0.05


def test_neighbours_are_recalled(figures):
    assert figures["neighbours"]["recall_at_48"] >= 0.99
    assert figures["paper's neighbours"]["index_recall_at_48"] >= 0.99
    assert figures["paper's neighbours"]["graph_recall_at_48"] >= 0.9


def test_growth_is_that_of_the_largest_database_over_the_smallest(database, tmp_path):  # noqa: F811
    small = build_database([strolling(0)], tmp_path / "small")
    found = growth([database, small], BenchPlan(frames=80, clip_frames=40))
    assert list(found) == [f"{len(small)} poses", f"{len(database)} poses", "largest over smallest"]
    of_small, of_large = (found[f"{len(d)} poses"]["processor_ms"]["p50"] for d in (small, database))
    assert found["largest over smallest"]["processor_ms"]["p50"] == pytest.approx(of_large / of_small, abs=0.01)
