"""What a take is solved with: read from the take's own session, from options, and from `solver.method=paper` lines."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from capture.config import CharacterConfig, SessionConfig
from devices.errors import SettingError, choice_error
from devices.intake_settings import INTAKE_SETTINGS
from reconstruction.solver_settings import METHODS, SolverSettings
from replay_logs.take import Take, read_take

_SESSION_KEYS = (
    "performer.height_m",
    "performer.profile",
    "database.path",
    *(f"character.{name}" for name in CharacterConfig.model_fields),
)
"""The keys of `session.toml` that a solved take depends on; the solver's own are those of `SolverSettings`."""
CALIBRATION = "calibration"
"""The key of a take's metadata that holds the text of the performer's profile."""


@dataclass(frozen=True)
class SolveSettings:
    """Everything that the poses of a take follow from, beside its bytes.

    session: only what was said counts; what was not is the database's body, our own library, the mannequin.
    calibration: what the session's profile said, where the take holds it; its place may be on another machine.
    device: by device and key of `INTAKE_SETTINGS`, what stands in place of the take's own settings.
    trackers: the roles that are used, with commas between; all where None.
    """

    session: SessionConfig = field(default_factory=SessionConfig)
    solver: SolverSettings = field(default_factory=SolverSettings)
    calibration: str = ""
    device: Mapping[str, Mapping[str, float | bool]] = field(default_factory=dict)
    trackers: str | None = None

    @property
    def height_m(self) -> float | None:
        """The performer's stature, or None where nobody said it."""
        performer = self.session.performer
        return performer.height_m if "height_m" in performer.model_fields_set else None

    @property
    def profile(self) -> str:
        """The calibration profile's path, or nothing."""
        return self.session.performer.profile

    @property
    def database(self) -> str:
        """The motion database's folder, or `library`."""
        return self.session.database.path

    def with_values(self, **values: object) -> "SolveSettings":
        """With these session keys, their dots written as two underscores, set where the value is not None."""
        given = {name.replace("__", "."): value for name, value in values.items() if value is not None}
        return _with_all(self, given.items())


def recorded_settings(take: Take) -> SolveSettings:
    """What the session that recorded a take had said of performer, database, solver and character.

    A value that is the default counts as not said.
    """
    try:
        values = tomllib.loads(take.metadata.get("session", ""))
        config = SessionConfig.model_validate(_known(values))
    except (tomllib.TOMLDecodeError, ValidationError):
        return SolveSettings()
    default, settings = SessionConfig(), SolveSettings()
    for key in (*_SESSION_KEYS, "solver.method"):
        section, name = key.split(".")
        value = getattr(getattr(config, section), name)
        if value != getattr(getattr(default, section), name):
            settings = _with(settings, key, value)
    return replace(settings, calibration=take.metadata.get(CALIBRATION, "") if settings.profile else "")


def settings_for(take: Path, given: Mapping[str, object]) -> SolveSettings:
    """What the take's session said, and above it what is given, as `with_values` takes it. Raises FileError."""
    said = recorded_settings(read_take(take)) if take.suffix.lower() == ".mcap" else SolveSettings()
    return said.with_values(**given)


def _known(values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The part of a session file of whatever version that this version knows and that matters here."""
    wanted = {*_SESSION_KEYS, "solver.method"}
    return {
        section: {name: value for name, value in table.items() if f"{section}.{name}" in wanted}
        for section, table in values.items()
        if isinstance(table, dict) and any(key.startswith(f"{section}.") for key in wanted)
    }


def apply_settings(settings: SolveSettings, changes: Iterable[str]) -> SolveSettings:
    """The settings with changes such as `solver.method=paper` or `device.trackers.smooth=true`.

    A value is written as in TOML; text needs no quotes. Raises SettingError that names the keys there are, or the
    values that are right.
    """
    return _with_all(settings, map(_parted, changes))


def allowed_keys(settings: SolveSettings | None = None) -> list[str]:
    """Every key that `apply_settings` takes; `device.NAME` stands for any device of the take."""
    solver = (settings or SolveSettings()).solver
    return [*_SESSION_KEYS, "trackers", *(f"solver.{name}" for name, _ in _leaves(solver)), *_device_keys("NAME")]


def _parted(change: str) -> tuple[str, object]:
    key, equals, text = (part.strip() for part in change.partition("="))
    if not equals or not key or not text:
        raise SettingError(f"{change!r}: write a setting as key=value, for example solver.method=paper")
    try:
        return key, tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return key, text


def _with_all(settings: SolveSettings, changes: Iterable[tuple[str, object]]) -> SolveSettings:
    for key, value in changes:
        settings = _with(settings, key, value)
    return settings


def _with(settings: SolveSettings, key: str, value: object) -> SolveSettings:
    section, _, name = key.partition(".")
    if key in _SESSION_KEYS:
        if section == "performer":  # what is said last of the body counts: another profile, or a stature instead
            settings = replace(settings, calibration="")
            if name == "height_m" and settings.profile:
                settings = replace(settings, session=_session_with(settings.session, section, "profile", ""))
        return replace(settings, session=_session_with(settings.session, section, name, value))
    if key == "trackers":
        return replace(settings, trackers=str(value))
    if section == "solver" and key in allowed_keys(settings):
        return replace(settings, solver=_solver_with(settings.solver, key, name.split("."), value))
    if section == "device":
        return replace(settings, device=_device_with(settings.device, key, name, value))
    allowed = allowed_keys(settings)
    near = [known for known in allowed if known.startswith(f"{section}.")]
    raise choice_error("setting", key, near or dict.fromkeys(f"{known.split('.')[0]}..." for known in allowed))


def _session_with(session: SessionConfig, section: str, name: str, value: object) -> SessionConfig:
    said = session.model_dump(exclude_unset=True)
    said[section] = said.get(section, {}) | {name: value}
    try:
        return SessionConfig.model_validate(said)
    except ValidationError as error:
        problem = error.errors()[0]["msg"].lower()
        raise SettingError(f"{section}.{name}: {problem}, not {value!r}") from None


def _solver_with(settings: Any, key: str, path: list[str], value: object) -> Any:
    """A copy of (nested) dataclasses with one field changed."""
    name, *inner = path
    now = getattr(settings, name)
    if key == "solver.method" and value not in METHODS:
        raise choice_error(key, value, METHODS)
    changed = _solver_with(now, key, inner, value) if inner else _of_kind(key, now, value)
    try:
        return replace(settings, **{name: changed})
    except ValueError as error:
        raise SettingError(f"{key}: {error}") from None


def _of_kind(key: str, now: object, value: object) -> object:
    """The value as that setting has it. Raises SettingError where it is of another kind, or no quantity."""
    if isinstance(now, bool):
        if not isinstance(value, bool):
            raise SettingError(f"{key}: true or false, not {value!r}")
        return value
    if isinstance(now, str):
        if not isinstance(value, str):
            raise SettingError(f"{key}: a word such as {now!r}, not {value!r}")
        return value
    whole = isinstance(now, int)
    if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
        raise SettingError(f"{key}: a {'whole ' if whole else ''}number such as {now}, not {value!r}")
    if not isfinite(value) or value < 0:
        raise SettingError(f"{key}: 0 or more, not {value!r}")
    return value if whole else float(value)


def _leaves(settings: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    """Dotted name and value of every field of nested dataclasses that is a number, a word or a switch."""
    for entry in fields(settings):  # type: ignore[arg-type]
        value = getattr(settings, entry.name)
        if is_dataclass(value):
            yield from _leaves(value, f"{prefix}{entry.name}.")
        elif isinstance(value, bool | int | float | str):
            yield f"{prefix}{entry.name}", value


def _device_keys(name: str) -> list[str]:
    return [f"device.{name}.{key}" for key in INTAKE_SETTINGS]


def _device_with(
    devices: Mapping[str, Mapping[str, float | bool]], key: str, name: str, value: object
) -> Mapping[str, Mapping[str, float | bool]]:
    device, _, setting = name.rpartition(".")
    if not device or setting not in INTAKE_SETTINGS:
        raise choice_error("setting", key, _device_keys(device or "NAME"))
    if not isinstance(value, bool | int | float):
        raise SettingError(f"{key}: a number, true or false, not {value!r}")
    return {**devices, device: {**devices.get(device, {}), setting: value}}
