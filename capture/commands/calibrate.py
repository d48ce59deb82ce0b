"""`sixpoint calibrate`: the performer's body and how the trackers sit on it."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.live import Config, Device, Port, configured
from capture.commands.options import AsJson, Database
from replay_logs.atomic_file import check_file_place

_PROFILE = Path("profile.json")


def calibrate(
    session: Config = None,
    out: Annotated[
        Path | None, typer.Option(help="The profile to write (.json); profile.json where there is no name either.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Keep the profile under the performer's name.")] = None,
    listed: Annotated[bool, typer.Option("--list", help="List the performers with a name, and stop.")] = False,
    device: Device = None,
    port: Port = None,
    take: Annotated[
        Path | None, typer.Option(help="Calibrate from this take or tracks file, not from devices.")
    ] = None,
    height_m: Annotated[float | None, typer.Option(min=0.8, max=2.5, help="Stature, where it is known.")] = None,
    seconds: Annotated[float, typer.Option(min=3, help="How long to move freely.")] = 15.0,
    database: Database = "library",
    as_json: AsJson = False,
) -> None:
    """Find the performer's segment lengths and the trackers' offsets.

    Stand in a T-pose for three seconds, then move freely: bend knees and elbows, turn, walk a little. With --name anna
    the profile is `anna` from then on: `profile = "anna"` under [performer] in session.toml, or `reconstruct --profile
    anna`; --out writes it to a file, whose path may be given in the same places.
    """
    from capture.calibrating import calibrate_from_devices, calibrate_from_file, report, report_profiles
    from capture.profiles import checked_name, save_profile

    if listed:
        report_profiles(as_json)
        return
    if name is not None:
        checked_name(name)
    if out is not None or name is None:
        check_file_place(out or _PROFILE)
    if take is not None:
        result = calibrate_from_file(take, database, height_m)
    else:
        result = calibrate_from_devices(configured(session, device, port), seconds, database, height_m)
    kept = save_profile(name, result.profile) if name is not None else None
    if out is not None or kept is None:
        kept = out or _PROFILE
        result.profile.write(kept)
    report(result, kept, as_json)
