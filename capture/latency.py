"""Where the time of a frame goes: each stage's last few thousand durations, and their percentiles."""

from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

PERCENTILES = (50, 95, 99)


def percentiles_ms(milliseconds: NDArray[np.float64]) -> dict[str, float]:
    """`p50`, `p95`, `p99` and `max` of some durations (N,)."""
    values = np.percentile(milliseconds, PERCENTILES)
    row = {f"p{p}": round(float(v), 4) for p, v in zip(PERCENTILES, values, strict=True)}
    return row | {"max": round(float(np.max(milliseconds)), 4)}


class LatencyRecorder:
    """Keeps the newest `capacity` durations of each stage, in order of first appearance."""

    def __init__(self, capacity: int = 3600) -> None:
        self._capacity = capacity
        self._stages: dict[str, deque[int]] = {}

    def add(self, stage: str, nanoseconds: int) -> None:
        """One more duration of that stage."""
        if stage not in self._stages:
            self._stages[stage] = deque(maxlen=self._capacity)
        self._stages[stage].append(nanoseconds)

    def add_all(self, stages: Mapping[str, int]) -> None:
        """One more duration, in nanoseconds, of each of these stages."""
        for stage, nanoseconds in stages.items():
            self.add(stage, nanoseconds)

    def summary(self) -> dict[str, dict[str, float]]:
        """Milliseconds by stage: `p50`, `p95`, `p99`, `max`. From any thread."""
        stages = list(self._stages.items())
        return {stage: percentiles_ms(np.array(values) * 1e-6) for stage, values in stages}


def latency_table(summary: Mapping[str, Mapping[str, float]], title: str = "milliseconds a frame") -> object:
    """A rich table of a `LatencyRecorder.summary`."""
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    table.add_column("stage")
    columns = [f"p{p}" for p in PERCENTILES] + ["max"]
    for column in columns:
        table.add_column(column, justify="right")
    for stage, row in summary.items():
        table.add_row(stage, *(f"{row[column]:.2f}" for column in columns))
    return table
