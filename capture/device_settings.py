"""A device's gate and smoothing as live settings."""

from capture.tuning import LiveSetting
from devices.intake import DeviceIntake
from devices.intake_settings import INTAKE_SETTINGS, read_setting, write_setting


def device_settings(name: str, intake: DeviceIntake) -> list[LiveSetting]:
    """What can be changed of one device while it is read, named `device.NAME.KEY`."""
    return [
        LiveSetting(
            f"device.{name}.{key}",
            setting.text,
            lambda key=key: read_setting(intake, key),
            lambda value, key=key: write_setting(intake, key, value),
            setting.unit,
            setting.low,
            setting.high,
            setting.step,
        )
        for key, setting in INTAKE_SETTINGS.items()
    ]
