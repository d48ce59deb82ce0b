"""What of an intake may be changed between two samples, by the names that `session.toml` and takes have."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from devices.errors import choice_error
from devices.filters import GateSettings, OneEuroSettings
from devices.intake import DeviceIntake

Value = float | bool


@dataclass(frozen=True, slots=True)
class IntakeSetting:
    """One of them: `field` of the intake's gate or smoothing. low, high: its range; step: what one press adds."""

    part: Literal["gate", "smoothing"]
    field: str
    text: str
    unit: str = ""
    low: float = 0.0
    high: float = 1.0
    step: float = 1.0


INTAKE_SETTINGS: Mapping[str, IntakeSetting] = {
    "smooth": IntakeSetting("smoothing", "on", "One-Euro smoothing"),
    "smooth_above_mm": IntakeSetting("smoothing", "noise_above_mm", "smoothing: least noise", "mm", 0.0, 50.0, 0.5),
    "min_cutoff_hz": IntakeSetting("smoothing", "min_cutoff_hz", "smoothing: cut-off at rest", "Hz", 0.1, 50.0, 0.5),
    "beta": IntakeSetting("smoothing", "beta", "smoothing: cut-off gained with speed", "Hz per m/s", 0.0, 500.0, 5.0),
    "speed_cutoff_hz": IntakeSetting(
        "smoothing", "speed_cutoff_hz", "smoothing: cut-off of the speed", "Hz", 0.1, 50.0, 0.5
    ),
    "gate": IntakeSetting("gate", "on", "outlier gate"),
    "max_speed_m_s": IntakeSetting("gate", "max_speed_m_s", "gate: fastest that is believed", "m/s", 1.0, 100.0, 1.0),
    "accept_after": IntakeSetting("gate", "accept_after", "gate: readings that prove a jump", "", 1.0, 120.0, 1.0),
    "min_quality": IntakeSetting("gate", "min_quality", "gate: least quality", "", 0.0, 1.0, 0.05),
}


def read_setting(intake: DeviceIntake, key: str) -> Value:
    """What a setting is. Raises SettingError for an unknown key."""
    setting = _setting(key)
    value = getattr(_part(intake, setting), setting.field)
    return value if isinstance(value, bool) else float(value)


def write_setting(intake: DeviceIntake, key: str, value: Value) -> None:
    """Changes a setting for the samples to come. Raises SettingError for an unknown key or what the filter refuses."""
    setting = _setting(key)
    part = _part(intake, setting)
    kind = type(getattr(part, setting.field))
    setattr(intake, setting.part, replace(part, **{setting.field: kind(value)}))


def _setting(key: str) -> IntakeSetting:
    if key not in INTAKE_SETTINGS:
        raise choice_error("setting of a device", key, INTAKE_SETTINGS)
    return INTAKE_SETTINGS[key]


def _part(intake: DeviceIntake, setting: IntakeSetting) -> GateSettings | OneEuroSettings:
    if setting.part == "gate":
        return intake.gate or GateSettings(on=False)
    return intake.smoothing or OneEuroSettings(on=False)
