from capture.bench_reconstruct import BenchPlan, bench_reconstruct
from tests.reconstruction.conftest import database  # noqa: F401 - a fixture


def test_measures_every_stage_and_agrees_with_least_squares(database):  # noqa: F811
    figures = bench_reconstruct(database, BenchPlan(frames=60, clip_frames=30))
    assert set(figures["default"]["stages_ms"]) == {"prior", "map", "rest"}
    assert figures["neighbours"]["recall_at_48"] >= 0.99
    assert abs(figures["map problem"]["energy_above_least_squares"]["max"]) < 0.05
