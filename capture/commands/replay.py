"""`sixpoint replay`: a take in the window, alone or solved in two ways side by side."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from capture.commands.options import Height, ProfileFile
from devices.errors import SettingError, SixpointError

if TYPE_CHECKING:
    from capture.playing import PerformanceSource
    from capture.scenario import Played
    from capture.solve_settings import SolveSettings


def replay(
    take: Annotated[Path, typer.Argument(help="A take (.mcap), tracks (.csv), or a motion (.bvh, .amc).")],
    database: Annotated[
        str | None, typer.Option(help="A folder made by `database build`, or `library` for our own.")
    ] = None,
    character: Annotated[str | None, typer.Option(help="`mannequin`, or a character's file.")] = None,
    resolution: Annotated[str | None, typer.Option(help="The mannequin's: low, medium or high.")] = None,
    height_m: Height = None,
    profile: ProfileFile = None,
    changes: Annotated[
        list[str] | None, typer.Option("--with", help="A setting to change, such as solver.method=paper; repeatable.")
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Without the changes on the left, with them on the right.")
    ] = False,
) -> None:
    """Play a take: space pauses, arrows seek, comma and full stop step, brackets change the speed, H shows all keys.

    What an option does not say is as the session said it that recorded the take.
    """
    from capture.scenario import TAKES, played, said
    from capture.solve_settings import apply_settings
    from capture.viewer import has_display, show

    is_take = take.suffix.lower() in TAKES
    if compare and not is_take:
        raise SettingError(f"{take}: a motion is not solved; --compare is for takes and tracks")
    if compare and not changes:
        raise SettingError("--compare needs --with: say which setting changes, such as --with solver.method=paper")
    who = {"performer__height_m": height_m, "performer__profile": None if profile is None else str(profile)}
    look = {"character__mesh": character, "character__resolution": resolution}
    before = said(take, database__path=database, **who, **look)
    after = apply_settings(before, changes or ())
    if not has_display():
        raise SixpointError("no display here to play in; `sixpoint demo --out DIR` and `sixpoint deform` make pictures")
    right = _source(take.name, shown := played(take, after), after)
    if not compare:
        show(right, title=f"sixpoint: {take.name}", actions=right.actions())
        return
    from capture.comparing import compared
    from capture.side_by_side import SideBySideSource

    left = _source(take.name, original := played(take, before), before)
    assert original.solved
    assert shown.solved
    comparison = compared(take.name, original.solved, shown.solved)
    both = SideBySideSource(left, right, comparison, ("as it was recorded", ", ".join(changes or ())))
    show(both, title=f"sixpoint: {take.name}", actions=both.actions())


def _source(name: str, shown: "Played", settings: "SolveSettings") -> "PerformanceSource":
    from capture.character_settings import configured_cast, deform_settings
    from capture.playing import PerformanceSource
    from capture.progress import tell_all

    look = settings.session.character
    chosen = configured_cast(look, shown.performance.motion.skeleton, shown.reference)
    tell_all(chosen.notes)
    return PerformanceSource(shown.performance, chosen, name, deform_settings(look))
