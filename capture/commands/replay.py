"""`sixpoint replay`: a take in the window."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import CharacterName, Database, Height, Resolution
from devices.errors import SixpointError


def replay(
    take: Annotated[Path, typer.Argument(help="A take (.mcap), tracks (.csv), or a motion (.bvh, .amc).")],
    database: Database = "library",
    character: CharacterName = "mannequin",
    resolution: Resolution = "medium",
    height_m: Height = None,
) -> None:
    """Play a take: space pauses, arrows seek, comma and full stop step, brackets change the speed, H shows all keys."""
    from capture.playing import PerformanceSource
    from capture.scenario import performance_of, staged
    from capture.viewer import has_display, show

    if not has_display():
        raise SixpointError("no display here to play in; `sixpoint demo --out DIR` and `sixpoint deform` make pictures")
    performance, reference = performance_of(take, database, height_m)
    stage, deformer = staged(performance.motion.skeleton, character, resolution, reference)
    show(PerformanceSource(performance, stage, deformer, title=take.name), title=f"sixpoint: {take.name}")
