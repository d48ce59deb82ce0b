"""Device protocols, one family a file. Every `DeviceProtocol` in this folder is found by itself and by its name."""

import importlib
import pkgutil
import tomllib
from dataclasses import MISSING, Field, fields
from functools import cache

from devices.errors import SettingError, choice_error
from devices.protocols.protocol import DeviceProtocol

_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text", tuple: "a list"}


@cache
def protocols() -> dict[str, type[DeviceProtocol]]:
    """Every protocol of this folder by name, in the order of names."""
    for module in pkgutil.iter_modules(__path__, f"{__name__}."):
        importlib.import_module(module.name)
    return dict(sorted((p.name, p) for p in _subclasses(DeviceProtocol) if "name" in vars(p)))


def make_protocol(name: str, **options: object) -> DeviceProtocol:
    """A fresh protocol. Raises SettingError that lists the valid names or options where one is unknown."""
    if name not in protocols():
        raise choice_error("device", name, protocols())
    chosen = protocols()[name]
    allowed = [f.name for f in fields(chosen) if f.init]
    for option in options:
        if option not in allowed:
            raise choice_error(f"option of device {name}", option, allowed or ["none: it has no options"])
    defaults = {f.name: _default(f) for f in fields(chosen) if f.init}
    return chosen(**{name_: _checked(name, name_, value, defaults[name_]) for name_, value in options.items()})


def option_from_text(name: str, text: str) -> tuple[str, object]:
    """An option of a device as a user types it, `full_scale_in=144`, with the value in TOML's manner.

    Raises SettingError where it is not of that form.
    """
    option, equals, value = text.partition("=")
    if not equals:
        raise SettingError(f"option {text!r} of device {name}: write it as name=value")
    try:
        return option.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        # A bare word is text.
        return option.strip(), value.strip()


def _default(option: Field) -> object:
    return option.default if option.default is not MISSING else option.default_factory()  # type: ignore[misc]


def _checked(device: str, option: str, value: object, default: object) -> object:
    """The value, as its default's type; tuples come as lists from TOML and JSON. Raises SettingError."""
    if isinstance(default, tuple) and isinstance(value, list | tuple):
        return tuple(value)
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not type(default):
        kind = _KINDS.get(type(default), type(default).__name__)
        raise SettingError(f"option {option} of device {device} is {value!r}: it must be {kind}")
    return value


def _subclasses(base: type[DeviceProtocol]) -> list[type[DeviceProtocol]]:
    here = [child for child in base.__subclasses__() if child.__module__.startswith(f"{__name__}.")]
    return [found for child in here for found in (child, *_subclasses(child))]
