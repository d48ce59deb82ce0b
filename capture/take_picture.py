"""A small picture of a take: when each role was seen, where the marks are, how well the database knew the movement."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from replay_logs.atomic_file import written_beside
from replay_logs.summary import TakeSummary

_SEEN, _LOST = "#2f8f5b", "#d9442f"
_INK, _PAPER = "#33373d", "#ffffff"
_COLUMNS = 480
_BLOCKS = " ▁▂▃▄▅▆▇█"


def timeline_text(seen: NDArray[np.float64]) -> str:
    """One block a stretch, as high as the share of it in which a role was seen: full, unless something is missing."""
    return "".join(_BLOCKS[int(np.floor(share * (len(_BLOCKS) - 1) + 1e-6))] for share in seen)


def draw_take(summary: TakeSummary, path: Path, coverage: NDArray[np.float64] | None = None) -> None:
    """Writes a PNG: a strip a role, green where it was seen and red where it was not, with the marks.

    coverage: (T,) of the solved take at equal times, drawn below where it is given: about 1 inside the database.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = len(summary.roles)
    heights = [0.34 * rows] + ([1.1] if coverage is not None else [])
    figure = Figure(figsize=(9.6, sum(heights) + 0.9), layout="constrained", facecolor=_PAPER)
    FigureCanvasAgg(figure)
    places = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0]
    _strips(places[0], summary)
    if coverage is not None:
        _curve(places[1], summary.duration_s, coverage)
    places[-1].set_xlabel("seconds", color=_INK)
    longest = max((role.longest_s for role in summary.roles if role.readings), default=0.0)
    places[0].set_title(
        f"{summary.name}   {summary.duration_s:.1f} s, longest dropout {longest:.2f} s",
        loc="left", fontsize=11, color=_INK, pad=16 if summary.marks else 6,
    )  # fmt: skip
    with written_beside(path) as part:
        figure.savefig(part, dpi=100, format="png")


def _strips(axes, summary: TakeSummary) -> None:
    edges = np.linspace(0, max(summary.duration_s, 1e-3), _COLUMNS + 1)
    for row, role in enumerate(summary.roles):
        seen = role.timeline(summary.duration_s, _COLUMNS)
        for colour, bottom, height in ((_SEEN, 0.0, seen), (_LOST, seen, 1.0 - seen)):
            low = len(summary.roles) - 1 - row + 0.12 + 0.76 * np.asarray(bottom)
            axes.bar(edges[:-1], 0.76 * height, np.diff(edges), low, align="edge", color=colour, linewidth=0)
        words = f"{role.seen:.1%}  {role.rate_hz:.0f} Hz" if role.readings else "never seen"
        axes.text(1.008, (len(summary.roles) - row - 0.5) / len(summary.roles), words, transform=axes.transAxes,
                  va="center", fontsize=9, color=_INK)  # fmt: skip
    axes.set_ylim(0, len(summary.roles))
    axes.set_xlim(0, edges[-1])
    names = [role.role.replace("_", " ") for role in summary.roles]
    axes.set_yticks(len(names) - 0.5 - np.arange(len(names)), names)
    axes.tick_params(length=0, colors=_INK)
    axes.spines[:].set_visible(False)
    for time_s, text in summary.marks:
        axes.axvline(time_s, color=_INK, linewidth=1, linestyle=(0, (3, 2)))
        axes.text(time_s, len(names), text[:24], fontsize=8, ha="center", va="bottom", color=_INK)


def _curve(axes, duration_s: float, coverage: NDArray[np.float64]) -> None:
    times = np.linspace(0, duration_s, len(coverage))
    known = np.where(np.isfinite(coverage), coverage, np.nan)
    axes.axhspan(0, 1.5, color=_SEEN, alpha=0.12, linewidth=0)
    axes.plot(times, known, color=_INK, linewidth=1)
    axes.set_ylim(0, max(3.0, float(np.nanpercentile(known, 99)) * 1.15) if np.isfinite(known).any() else 3.0)
    axes.set_ylabel("coverage", color=_INK)
    axes.tick_params(colors=_INK)
    axes.spines[["top", "right"]].set_visible(False)
