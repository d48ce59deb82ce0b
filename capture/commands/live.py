"""`sixpoint live` and `sixpoint record`: a session with devices."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from capture.commands.options import AsJson
from devices.errors import SettingError

if TYPE_CHECKING:
    from capture.config import SessionConfig

Config = Annotated[Path | None, typer.Argument(help="session.toml; without it every setting is its default.")]
Device = Annotated[str | None, typer.Option(help="The protocol of the one device, instead of the configured ones.")]
Port = Annotated[str | None, typer.Option(help="Its port: a path, socket://host:port, or a HID path.")]
Seconds = Annotated[float | None, typer.Option(min=0.1, help="End after that long; else with Ctrl-C.")]


def live(
    session: Annotated[
        Path | None,
        typer.Argument(help="session.toml; without it the one in this folder, or a guide where there is none."),
    ] = None,
    device: Device = None,
    port: Port = None,
    profile: Annotated[str | None, typer.Option(help="The performer, as `sixpoint calibrate --list` has them.")] = None,
    take: Annotated[Path | None, typer.Option("--record", help="Keep everything in this take (.mcap).")] = None,
    seconds: Seconds = None,
    window: Annotated[bool, typer.Option(help="Show the character in a window, where there is a display.")] = True,
    guide: Annotated[
        bool | None,
        typer.Option(help="Ask what is not known, and calibrate; by default where nothing is configured."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Solve what the trackers send, show it, and keep it if asked.

    With nothing configured it finds the tracker, asks who performs, guides through the calibration and saves all that
    as session.toml, so that the next time it starts at once.
    """
    from capture.going_live import go_live, tell
    from capture.setting_up import SESSION_FILE

    if session is None and device is None and port is None and guide is not True and SESSION_FILE.exists():
        tell(f"as {SESSION_FILE} in this folder says")
        session = SESSION_FILE
    if session is None and (guide or (guide is None and device is None and port is None)):
        config, session = _guided(device, port, profile, window)
    else:
        config = _with_profile(configured(session, device, port), profile)
    go_live(config, take, seconds, window, as_json, session)


def _guided(
    device: str | None, port: str | None, profile: str | None, window: bool
) -> "tuple[SessionConfig, Path | None]":
    """The configuration that a guide finds out. Raises SettingError where there is nobody to guide."""
    from capture.asking import TerminalAsker, can_ask
    from capture.guided_session import set_up_session
    from capture.viewer import has_display

    if not can_ask():
        raise SettingError(
            "nothing is configured, and there is no terminal to ask at: give --device and --port (`sixpoint devices`"
            " lists them), or a session.toml (`sixpoint config init` writes one)"
        )
    named = configured(None, device, port).device
    return set_up_session(TerminalAsker(), named[0] if named else None, profile, window and has_display())


def _with_profile(config: "SessionConfig", profile: str | None) -> "SessionConfig":
    if profile is None:
        return config
    return config.model_copy(update={"performer": config.performer.model_copy(update={"profile": profile})})


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
