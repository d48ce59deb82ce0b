"""An experiment's tables and figure as CSV, Markdown and PNG."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from capture.evaluation import Experiment, Row, mean_scores
from capture.evaluation_runs import Score
from replay_logs.atomic_file import written_beside

PRINTED_NAMES = {
    "gplvm": "GPLVM style IK (Grochow 2004)",
    "lpca": "local PCA (Chai and Hodgins 2005)",
    "lpcr": "local PCR (Liu 2011)",
    "nearest": "nearest pose",
    "mean-16": "mean of 16 nearest",
    "mean-16-ik": "mean of 16 nearest, then IK",
    "damped-ik": "damped least squares IK",
    "paper": "the paper's method",
    "default": "sixpoint",
}
_FIGURE_COUNTS = (6, 4)

Table = dict[tuple[str, str], Row]
"""Cells by (method, column)."""


def tables_of(experiment: Experiment) -> dict[str, Table]:
    """Table 1 (by number of trackers), table 2 (by database) and figure 3's bars (by action, six and four trackers)."""
    large = [s for s in experiment.scores if s.database == "large"]
    found = {
        "table1": mean_scores(large, lambda s: (s.method, str(s.trackers))),
        "table2": mean_scores(
            (s for s in experiment.scores if s.trackers == 6),
            lambda s: (s.method, f"{experiment.poses[s.database]} poses"),
        ),
    }
    for count in _FIGURE_COUNTS:
        found[f"figure3_{count}"] = mean_scores(
            (s for s in large if s.trackers == count), lambda s: (s.method, s.action)
        )
    return {name: table for name, table in found.items() if table}


TITLES = {
    "table1": "Table 1: error by number of trackers",
    "table2": "Table 2: error by database, six trackers",
    "figure3_6": "Figure 3: error by action, six trackers",
    "figure3_4": "Figure 3: error by action, four trackers",
}


def markdown(experiment: Experiment) -> str:
    """Every table, `degrees per degree of freedom / centimetres`, the least of each column in bold where there are
    several."""
    split, plan = experiment.split, experiment.plan
    solved = len({score.clip for score in experiment.scores})
    lines = [
        f"{len(split.training)} clips in the large database ({experiment.poses['large']} poses),"
        f" {experiment.poses['small']} poses in the small one; {len(split.held_out)} clips held out, {solved} of them"
        f" solved, at most {plan.seconds:g} s of each. Cells: mean |Euler error| per degree of freedom, degrees /"
        " mean joint position error, centimetres. Bold: the least of the column.",
    ]
    for name, table in tables_of(experiment).items():
        lines += ["", f"### {TITLES[name]}", "", *_markdown_table(table)]
    if any(score.trackers == 6 for score in experiment.scores):
        lines += ["", "### Smoothness and time, six trackers", "", *_cost_table(experiment)]
    if "default" in plan.methods:
        lines += ["", "### sixpoint by number of trackers", "", *_own_table(experiment)]
    return "\n".join(lines) + "\n"


def write_report(experiment: Experiment, folder: Path) -> list[Path]:
    """`scores.csv` (one clip and run a line), a CSV a table, `tables.md`, `figure3.png`. Returns what was written."""
    folder.mkdir(parents=True, exist_ok=True)
    written = [_write_csv(folder / "scores.csv", [_flat(score) for score in experiment.scores])]
    for name, table in tables_of(experiment).items():
        rows = [{"method": method, "column": column, **asdict(row)} for (method, column), row in table.items()]
        written.append(_write_csv(folder / f"{name}.csv", rows))
    text = markdown(experiment)
    written.append(_written_beside(folder / "tables.md", lambda part: part.write_text(text, encoding="utf-8")))
    if any(name.startswith("figure3") for name in tables_of(experiment)):
        written.append(_written_beside(folder / "figure3.png", lambda part: draw_figure(experiment, part)))
    return written


def draw_figure(experiment: Experiment, path: Path) -> None:
    """Figure 3: bars by action and method, six trackers above four."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    tables = {n: t for n, t in tables_of(experiment).items() if n.startswith("figure3")}
    figure = Figure(figsize=(11, 4.2 * len(tables)), layout="constrained")
    FigureCanvasAgg(figure)
    for place, (name, table) in enumerate(tables.items(), 1):
        methods, actions = _methods(table), _columns(table)
        axes = figure.add_subplot(len(tables), 1, place)
        width = 0.85 / len(methods)
        for number, method in enumerate(methods):
            heights = [table[method, action].euler_deg if (method, action) in table else 0.0 for action in actions]
            at = [i + (number - (len(methods) - 1) / 2) * width for i in range(len(actions))]
            colour = "#c8321e" if method == "default" else f"C{number % 9}" if number % 9 != 3 else "C9"
            axes.bar(at, heights, width, label=PRINTED_NAMES[method], color=colour)
        axes.set_title(TITLES[name])
        axes.set_xticks(range(len(actions)), actions)
        axes.set_ylabel("degrees per degree of freedom")
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(path, dpi=110, format="png")


def _markdown_table(table: Table) -> list[str]:
    methods, columns = _methods(table), _columns(table)
    lines = ["| | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    best = [_least(table, column, methods) for column in columns]
    for method in methods:
        cells = [_cell(table.get((method, column)), least) for column, least in zip(columns, best, strict=True)]
        lines.append(f"| {PRINTED_NAMES[method]} | " + " | ".join(cells) + " |")
    return lines


def _cost_table(experiment: Experiment) -> list[str]:
    rows = mean_scores(
        (s for s in experiment.scores if s.trackers == 6 and s.database == "large"), lambda s: (s.method,)
    )
    lines = ["| | jitter ratio | slide ratio | processor ms a frame | worst clip |", "|---|---|---|---|---|"]
    return lines + [
        f"| {PRINTED_NAMES[method]} | {row.jitter_ratio:.2f} | {row.slide_ratio:.2f} | {row.solve_ms:.2f}"
        f" | {row.worst_deg:.2f} / {row.worst_cm:.2f} |"
        for (method,), row in rows.items()
    ]


_DETAILS = "deg | worst clip deg | cm | worst clip cm | tracked cm | jitter ratio | slide ratio | within 1 sigma"


def _details(row: Row) -> str:
    return (
        f"{row.euler_deg:.2f} | {row.worst_deg:.2f} | {row.mpjpe_cm:.2f} | {row.worst_cm:.2f} | {row.tracked_cm:.2f}"
        f" | {row.jitter_ratio:.2f} | {row.slide_ratio:.2f} | {100 * row.within_sigma:.0f} %"
    )


def _own_table(experiment: Experiment) -> list[str]:
    """Everything about our own method, by number of trackers, on the large database."""
    rows = mean_scores(
        (s for s in experiment.scores if s.method == "default" and s.database == "large"), lambda s: (s.trackers,)
    )
    lines = [f"| trackers | {_DETAILS} |", "|---" * 9 + "|"]
    return lines + [f"| {trackers} | {_details(row)} |" for (trackers,), row in rows.items()]


def markdown_without_actions(scores: Sequence[Score]) -> str:
    """A table a method and number of trackers: each action left out of the database, and the mean of all clips."""
    lines: list[str] = []
    for method, trackers in dict.fromkeys((s.method, s.trackers) for s in scores):
        these = [s for s in scores if (s.method, s.trackers) == (method, trackers)]
        rows = mean_scores(these, lambda s: (s.action,)) | mean_scores(these, lambda s: ("all",))
        lines += ["", f"### {PRINTED_NAMES[method]}, {trackers} trackers, each action left out of the database", ""]
        lines += [f"| left out | clips | {_DETAILS} |", "|---" * 10 + "|"]
        lines += [f"| {action} | {row.clips} | {_details(row)} |" for (action,), row in rows.items()]
    return "\n".join(lines[1:]) + "\n"


def write_without_actions(scores: Sequence[Score], folder: Path) -> list[Path]:
    """`actions_scores.csv` (one clip and run a line) and `actions.md`. Returns what was written."""
    folder.mkdir(parents=True, exist_ok=True)
    text = markdown_without_actions(scores)
    return [
        _write_csv(folder / "actions_scores.csv", [_flat(score) for score in scores]),
        _written_beside(folder / "actions.md", lambda part: part.write_text(text, encoding="utf-8")),
    ]


def _least(table: Table, column: str, methods: Sequence[str]) -> tuple[float, float]:
    if len(methods) == 1:
        return -1.0, -1.0
    there = [table[m, column] for m in methods if (m, column) in table]
    return min(round(row.euler_deg, 2) for row in there), min(round(row.mpjpe_cm, 2) for row in there)


def _cell(row: Row | None, least: tuple[float, float]) -> str:
    if row is None:
        return ""
    figures = (row.euler_deg, row.mpjpe_cm)
    return " / ".join(
        f"**{v:.2f}**" if round(v, 2) <= best else f"{v:.2f}" for v, best in zip(figures, least, strict=True)
    )


def _methods(table: Table) -> list[str]:
    return list(dict.fromkeys(method for method, _ in table))


def _columns(table: Table) -> list[str]:
    return list(dict.fromkeys(column for _, column in table))


def _flat(score: Score) -> dict:
    row = asdict(score)
    return row | row.pop("accuracy")


def _write_csv(path: Path, rows: Sequence[dict]) -> Path:
    def write(part: Path) -> None:
        with part.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, [name for name in rows[0] if name != "accuracy"], extrasaction="ignore")
            writer.writeheader()
            writer.writerows({k: f"{v:.4f}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)

    return _written_beside(path, write)


def _written_beside(path: Path, write: Callable[[Path], object]) -> Path:
    """Writes a file beside its place and renames it into it."""
    with written_beside(path) as part:
        write(part)
    return path
