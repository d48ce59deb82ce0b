"""`sixpoint live` and `sixpoint record`: a session with devices."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from capture.commands.options import AsJson

if TYPE_CHECKING:
    from capture.config import SessionConfig

Config = Annotated[Path | None, typer.Argument(help="session.toml; without it every setting is its default.")]
Device = Annotated[str | None, typer.Option(help="The protocol of the one device, instead of the configured ones.")]
Port = Annotated[str | None, typer.Option(help="Its port: a path, socket://host:port, or a HID path.")]
Seconds = Annotated[float | None, typer.Option(min=0.1, help="End after that long; else with Ctrl-C.")]


def live(
    session: Config = None,
    device: Device = None,
    port: Port = None,
    take: Annotated[Path | None, typer.Option("--record", help="Keep everything in this take (.mcap).")] = None,
    seconds: Seconds = None,
    window: Annotated[bool, typer.Option(help="Show the character in a window, where there is a display.")] = True,
    as_json: AsJson = False,
) -> None:
    """Solve what the trackers send, show it, and keep it if asked."""
    from capture.going_live import go_live

    go_live(configured(session, device, port), take, seconds, window, as_json, session)


def record(
    session: Config = None,
    out: Annotated[Path | None, typer.Option(help="The take to make (.mcap); else one named by date and time.")] = None,
    device: Device = None,
    port: Port = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Keep everything that the trackers send in a take, without solving it."""
    from capture.going_live import keep

    keep(configured(session, device, port), out, seconds, as_json)


def configured(session: Path | None, device: str | None, port: str | None) -> "SessionConfig":
    """The session's configuration, with the one device that the command line names."""
    from capture.config import DeviceConfig, SessionConfig, read_config

    config = read_config(session) if session else SessionConfig()
    if device is None and port is None:
        return config
    one = config.device[0] if config.device else DeviceConfig()
    changed = {"protocol": device or one.protocol, "port": one.port if port is None else port}
    return config.model_copy(update={"device": (one.model_copy(update=changed),)})
