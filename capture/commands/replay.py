"""`sixpoint replay`: a take in the window."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import CharacterName, Database, Height, ProfileFile, Resolution
from devices.errors import SixpointError


def replay(
    take: Annotated[Path, typer.Argument(help="A take (.mcap), tracks (.csv), or a motion (.bvh, .amc).")],
    database: Database = "library",
    character: CharacterName = "mannequin",
    resolution: Resolution = "medium",
    height_m: Height = None,
    profile: ProfileFile = None,
) -> None:
    """Play a take: space pauses, arrows seek, comma and full stop step, brackets change the speed, H shows all keys."""
    from capture.characters import cast
    from capture.playing import PerformanceSource
    from capture.progress import tell_all
    from capture.scenario import performance_of
    from capture.viewer import has_display, show

    if not has_display():
        raise SixpointError("no display here to play in; `sixpoint demo --out DIR` and `sixpoint deform` make pictures")
    performance, reference = performance_of(take, database, height_m, profile)
    chosen = cast(character, performance.motion.skeleton, resolution, reference)
    tell_all(chosen.notes)
    show(PerformanceSource(performance, chosen, title=take.name), title=f"sixpoint: {take.name}")
