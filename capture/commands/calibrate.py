"""`sixpoint calibrate`: the performer's body and how the trackers sit on it."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.live import Config, Device, Port, configured
from capture.commands.options import AsJson, Database


def calibrate(
    session: Config = None,
    out: Annotated[Path, typer.Option(help="The profile to write (.json).")] = Path("profile.json"),
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

    Stand in a T-pose for three seconds, then move freely: bend knees and elbows, turn, walk a little. Put the profile's
    path into session.toml as [performer] profile, or give it to `reconstruct --profile`.
    """
    from capture.calibrating import calibrate_from_devices, calibrate_from_file, report

    if take is not None:
        profile = calibrate_from_file(take, database, height_m)
    else:
        profile = calibrate_from_devices(configured(session, device, port), seconds, database, height_m)
    profile.write(out)
    report(profile, out, as_json)
