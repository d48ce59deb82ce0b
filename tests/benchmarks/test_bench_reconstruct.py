import pytest

from capture.bench_reconstruct import BenchPlan, bench_reconstruct, growth
from tests.reconstruction.conftest import database  # noqa: F401 - a fixture


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


def test_growth_is_that_of_the_largest_database_over_the_smallest(figures):
    def on(poses: int, milliseconds: float) -> dict:
        times = {"p50": milliseconds, "p99": 2 * milliseconds}
        return {"database": {"poses": poses}, "default": {"frame_ms": times, "processor_ms": times}}

    assert growth([on(500, 3.0), on(9, 2.0), on(100, 9.0)])["frame_ms p99"] == 1.5
