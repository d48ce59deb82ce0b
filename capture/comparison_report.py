"""A comparison of settings as Markdown, JSON and a plot."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from capture.comparing import Comparison, pooled
from replay_logs.atomic_file import written_beside

_BEFORE, _AFTER, _INK = "#6b7280", "#c8321e", "#33373d"


def write_report(comparisons: Sequence[Comparison], changes: Sequence[str], stem: Path) -> list[Path]:
    """Writes `STEM.md`, `STEM.json`, and a plot of each take: `STEM.png`, or `STEM_TAKE.png` where there are several.

    Gives what was written.
    """
    text, values = markdown(comparisons, changes), json.dumps(as_dict(comparisons, changes, series=True))
    written = []
    for ending, content in ((".md", text), (".json", values)):
        with written_beside(stem.with_name(stem.name + ending)) as part:
            part.write_text(content, encoding="utf-8")
        written.append(stem.with_name(stem.name + ending))
    for comparison in comparisons:
        own = "" if len(comparisons) == 1 else f"_{Path(comparison.take).stem}"
        written.append(stem.with_name(f"{stem.name}{own}.png"))
        draw(comparison, changes, written[-1])
    return written


def as_dict(comparisons: Sequence[Comparison], changes: Sequence[str], series: bool = False) -> dict:
    """All figures as plain values; with what happens over time where `series`."""
    takes = [c.figures() | ({"over_time": c.over_time()} if series else {}) for c in comparisons]
    by_joint = {name: {"degrees": round(d, 4), "cm": round(c, 4)} for name, (d, c) in pooled(comparisons).items()}
    return {"changes": list(changes), "takes": takes, "all_by_joint": by_joint}


def markdown(comparisons: Sequence[Comparison], changes: Sequence[str]) -> str:
    """Two tables: each take's two solutions and how far they are apart, and the joints."""
    lines = [f"# What `{' '.join(changes)}` does", ""]
    lines += ["| take | | coverage | jitter m/s³ | p50 ms | p99 ms |", "|---|---|---|---|---|---|"]
    for comparison in comparisons:
        figures = comparison.figures()
        for side, name in (("before", comparison.take), ("after", "")):
            own = figures[side]
            cells = (f"{own['coverage']:.2f}", f"{own['jitter_m_s3']:.1f}")
            times = (f"{own['solve_ms']['p50']:.2f}", f"{own['solve_ms']['p99']:.2f}")
            lines.append(f"| {name} | {side} | {' | '.join((*cells, *times))} |")
    lines += ["", "| apart | mean ° | 95 % ° | most ° | mean cm | 95 % cm | most cm | of | at s |", "|---" * 9 + "|"]
    for comparison in comparisons:
        apart = comparison.figures()["difference"]
        degrees = (f"{apart[key]:.2f}" for key in ("degrees_mean", "degrees_p95", "degrees_max"))
        places = (f"{apart[key]:.2f}" for key in ("cm_mean", "cm_p95", "cm_max"))
        where = (apart["cm_max_joint"], f"{apart['cm_max_at_s']:.2f}")
        lines.append(f"| {comparison.take} | {' | '.join((*degrees, *places, *where))} |")
    lines += ["", "| joint | mean ° | mean cm |", "|---|---|---|"]
    lines += [f"| {name} | {d:.2f} | {c:.2f} |" for name, (d, c) in pooled(comparisons).items()]
    return "\n".join(lines) + "\n"


def draw(comparison: Comparison, changes: Sequence[str], path: Path) -> None:
    """Writes a PNG: degrees and centimetres apart and both coverages over time, and the joints beside."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6.2), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(3, 2, width_ratios=[2.2, 1])
    figure.suptitle(f"{comparison.take}: {', '.join(changes)}", x=0.01, ha="left", color=_INK)
    time_s = np.arange(len(comparison.degrees)) / comparison.fps
    first = None
    for row, (values, unit) in enumerate(((comparison.degrees, "degrees apart"), (comparison.centimetres, "cm apart"))):
        axes = figure.add_subplot(grid[row, 0], sharex=first)
        first = first or axes
        low, high = np.percentile(values, (50, 95), axis=1)
        axes.fill_between(time_s, low, high, color=_AFTER, alpha=0.18, linewidth=0, label="half to 95 % of the joints")
        axes.plot(time_s, values.mean(axis=1), color=_AFTER, linewidth=1.2, label="mean")
        axes.set_ylabel(unit)
        axes.set_ylim(bottom=0)
    figure.axes[0].legend(frameon=False, fontsize=8, loc="upper right", ncols=2)
    axes = figure.add_subplot(grid[2, 0], sharex=first)
    for solved, name, colour in ((comparison.before, "before", _BEFORE), (comparison.after, "after", _AFTER)):
        coverage = solved.reconstruction.coverage
        axes.plot(np.arange(len(coverage)) / solved.motion.fps, coverage, color=colour, linewidth=1.1, label=name)
    axes.set_ylabel("coverage")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("seconds")
    axes.legend(frameon=False, fontsize=8, loc="upper right", ncols=2)
    _joints(figure.add_subplot(grid[:, 1]), comparison)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=_INK)
    with written_beside(path) as part:
        figure.savefig(part, dpi=100, format="png")


def _joints(axes, comparison: Comparison) -> None:
    """Bars: how far each joint is apart, the mean over time."""
    means, rows = pooled([comparison]).values(), np.arange(len(comparison.joints))
    axes.barh(rows - 0.2, [degrees for degrees, _ in means], 0.38, color=_AFTER, label="degrees")
    axes.barh(rows + 0.2, [centimetres for _, centimetres in means], 0.38, color=_BEFORE, label="cm")
    axes.set_yticks(rows, comparison.joints, fontsize=8)
    axes.invert_yaxis()
    axes.legend(frameon=False, fontsize=8, loc="lower right")
    axes.set_xlabel("mean apart")
