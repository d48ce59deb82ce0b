"""The one error tree. Every message says what is wrong, where, and what would be right."""


class SixpointError(Exception):
    """Anything a user can mend. The command line prints it as one line and exits with status 2."""


class DeviceError(SixpointError):
    """A device cannot be opened, configured or read."""


class DeviceLost(DeviceError):
    """A device that was open is gone: unplugged, powered off, closed by the other end."""


class FileError(SixpointError):
    """A file is missing, broken, or not what its name says. Names the file and, where it can, the line."""


class SettingError(SixpointError):
    """A setting or argument is unknown or out of its range. Lists what is allowed."""


def choice_error(what: str, given: object, allowed: object) -> SettingError:
    """A `SettingError` that names the valid choices: `unknown tracker role 'hand': use root, head, ...`."""
    return SettingError(f"unknown {what} {given!r}: use {', '.join(map(str, allowed))}")  # type: ignore[call-overload]
