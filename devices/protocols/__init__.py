"""Device protocols, one family a file. Every `DeviceProtocol` in this folder is found by itself and by its name."""

import importlib
import pkgutil
from dataclasses import fields
from functools import cache

from devices.errors import choice_error
from devices.protocols.protocol import DeviceProtocol


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
    return chosen(**options)


def _subclasses(base: type[DeviceProtocol]) -> list[type[DeviceProtocol]]:
    here = [child for child in base.__subclasses__() if child.__module__.startswith(f"{__name__}.")]
    return [found for child in here for found in (child, *_subclasses(child))]
