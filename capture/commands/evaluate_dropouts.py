"""`sixpoint evaluate dropouts`."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import AsJson


def dropouts(
    data: Annotated[
        list[Path], typer.Option(help="Motion files of one skeleton, or folders of them; may be repeated.")
    ],
    out: Annotated[Path, typer.Option(help="The folder for the database, kept for the next run.")] = Path("evaluation"),
    lost: Annotated[str, typer.Option(help="The roles lost, one at a time, with commas.")] = "left_wrist,right_wrist",
    gap: Annotated[float, typer.Option(min=0.1, max=10, help="How long each is lost, seconds.")] = 1.0,
    clips: Annotated[int, typer.Option(min=1, help="Most held-out clips of an action.")] = 4,
    seconds: Annotated[float, typer.Option(min=1, help="Most seconds of a clip, from its middle.")] = 6.0,
    as_json: AsJson = False,
) -> None:
    """Measure what a tracker that is lost for a while costs: its limb, the rest of the body, and its return.

    Clips are held out as by `evaluate tables`; the rest is the database. Each is solved from six trackers, and again
    with one of them taken away in the middle. The return is the largest acceleration in 0.3 s after it, over the 99th
    percentile of the true clip's own: at 1 or less nobody sees it.
    """
    import json
    from dataclasses import asdict

    from capture.dropout_evaluation import evaluate_dropouts, table_of
    from capture.progress import stage_bars
    from devices.errors import choice_error
    from devices.sample import ROLES

    roles = [role.strip() for role in lost.split(",")]
    for role in roles:
        if role not in ROLES:
            raise choice_error("tracker role", role, ROLES)
    with stage_bars() as stage:
        scores = evaluate_dropouts(data, out, roles, gap, clips, seconds, stage)
    print(json.dumps([asdict(score) for score in scores]) if as_json else table_of(scores))
