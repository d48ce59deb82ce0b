"""Devices by name and port: makes the driver of any protocol on the link it speaks over."""

from collections.abc import Mapping
from dataclasses import replace

from devices.errors import SettingError
from devices.linked_device import LinkedDevice
from devices.protocols import make_protocol
from devices.serial_link import SerialLink


def make_device(
    protocol: str,
    port: str = "",
    *,
    name: str | None = None,
    baud: int | None = None,
    options: Mapping[str, object] | None = None,
) -> LinkedDevice:
    """A driver, not yet open.

    protocol: as `devices.protocols.protocols()` lists them. port: a serial port's path, URL or pattern, or a HID
    device's path; "" for the only one that fits. name: what the session calls it, by default the protocol's name.
    baud: instead of the protocol's own. options: the protocol's. Raises SettingError for an unknown name or option.
    """
    spoken = make_protocol(protocol, **options or {})
    if spoken.link == "hid":
        from devices.hid_link import HidLink

        if baud is not None:
            raise SettingError(f"device {protocol} is a HID device: it has no baud rate")
        return LinkedDevice(name or protocol, HidLink(port, spoken.hid), spoken)
    line = spoken.serial if baud is None else replace(spoken.serial, baud=baud)
    return LinkedDevice(name or protocol, SerialLink(port, line), spoken)
