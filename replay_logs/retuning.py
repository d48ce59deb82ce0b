"""A take with another gate or smoothing than it was recorded with: the bytes are there, so it can be decided anew."""

from collections.abc import Mapping
from dataclasses import replace

from devices.errors import SettingError, choice_error
from devices.intake_settings import INTAKE_SETTINGS, write_setting
from replay_logs.take import SettingsChange, Take

Settings = Mapping[str, Mapping[str, float | bool]]
"""Values by device and key of `INTAKE_SETTINGS`."""


def retuned(take: Take, settings: Settings) -> Take:
    """The take with these settings from its beginning to its end, whatever was changed while it was recorded.

    Raises SettingError for an unknown device or key, and for a value out of range.
    """
    known = {device.name: device for device in take.devices}
    for name, values in settings.items():
        if name not in known:
            raise choice_error(f"device in {take.path.name}", name, known)
        intake = known[name].intake()
        for key, value in values.items():
            _check(f"device.{name}.{key}", key, value)
            write_setting(intake, key, value)
        known[name] = replace(known[name], gate=intake.gate, smoothing=intake.smoothing)
    fixed = {f"device.{name}.{key}" for name, values in settings.items() for key in values}
    changes = tuple(_without(change, fixed) for change in take.changes)
    return replace(take, devices=tuple(known.values()), changes=changes)


def _check(name: str, key: str, value: float | bool) -> None:
    if key not in INTAKE_SETTINGS:
        raise choice_error("setting of a device", key, INTAKE_SETTINGS)
    setting = INTAKE_SETTINGS[key]
    if (setting.field == "on") != isinstance(value, bool):
        raise SettingError(f"{name}: {'true or false' if setting.field == 'on' else 'a number'}, not {value!r}")
    if not isinstance(value, bool) and not setting.low <= value <= setting.high:
        raise SettingError(f"{name}: a number from {setting.low:g} to {setting.high:g}, not {value!r}")


def _without(change: SettingsChange, fixed: set[str]) -> SettingsChange:
    return replace(change, values={name: value for name, value in change.values.items() if name not in fixed})
