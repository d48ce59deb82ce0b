"""Options that several commands share, worded once."""

from pathlib import Path
from typing import Annotated

import typer

Database = Annotated[str, typer.Option(help="A folder made by `database build`, or `library` for our own.")]
Height = Annotated[float | None, typer.Option(min=0.8, max=2.5, help="The performer's stature, metres.")]
ProfileFile = Annotated[
    Path | None, typer.Option("--profile", help="A performer's name or file of `sixpoint calibrate`.")
]
CharacterName = Annotated[str, typer.Option(help="`mannequin`, or a character's file.")]
Resolution = Annotated[str, typer.Option(help="The mannequin's: low, medium or high.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")]
Take = Annotated[Path, typer.Argument(help="A take (.mcap), or tracks (.csv).")]
JointNames = Annotated[
    str, typer.Option(help="What joints are called in the file: ours, blender, cmu, mixamo or motionbuilder.")
]
