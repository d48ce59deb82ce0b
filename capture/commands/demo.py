"""`sixpoint demo`: the main job with nothing attached."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import AsJson, Resolution


def demo(
    out: Annotated[Path | None, typer.Option(help="Where the files go; by default sixpoint_demo.")] = None,
    resolution: Resolution = "medium",
    window: Annotated[bool, typer.Option(help="Open a window, where there is a display.")] = True,
    seconds: Annotated[float | None, typer.Option(min=0.5, help="Only so much of the take.")] = None,
    as_json: AsJson = False,
) -> None:
    """Play the shipped take: tracker bytes in, poses solved, the character skinned.

    In a window where there is a display; else into OUT as pose.bvh, character.glb, frames, a GIF and the latencies.
    """
    from capture.demonstration import run_demo

    run_demo(out, resolution, window, seconds, as_json)
