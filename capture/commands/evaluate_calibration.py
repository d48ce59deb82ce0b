"""`sixpoint evaluate calibration`."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import AsJson


def calibration(
    data: Annotated[
        list[Path], typer.Option(help="Motion files of one skeleton, or folders of them; may be repeated.")
    ],
    out: Annotated[Path, typer.Option(help="The folder for the database, kept for the next run.")] = Path("evaluation"),
    bodies: Annotated[int | None, typer.Option(min=1, help="How many bodies of the grid; all where left out.")] = None,
    turns: Annotated[
        float | None, typer.Option(min=0, max=30, help="Trackers with orientations, of this noise in degrees.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure calibration on your data: made-up bodies of 1.50 to 1.95 m with trackers up to 8 cm off their joints.

    Clips are held out as by `evaluate tables`; the rest is the database. Every body of a fixed grid holds a T-pose,
    moves as in some of the held-out clips, and is calibrated; others are then solved on what was found, and on the true
    body with the true offsets: the ideal case. Errors are means over joints (cm) and degrees of freedom (deg).
    """
    import json

    from capture.calibration_evaluation import GRID, evaluate_calibration, row_of, table_of
    from capture.progress import stage_bars

    grid = [body.with_turns(turns) for body in GRID[:bodies]]
    with stage_bars() as stage:
        scores = evaluate_calibration(data, out, grid, stage)
    print(json.dumps([row_of(score) for score in scores]) if as_json else table_of(scores))
