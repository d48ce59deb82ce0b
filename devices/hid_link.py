"""HID devices: the only file that imports hidapi, its kernel back end (`hidraw`) or its libusb one (`hid`)."""

import contextlib
import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from devices.errors import DeviceError, DeviceLost
from devices.link import Link
from devices.protocols.protocol import HidMatch

BACK_ENDS = ("hidraw", "hid")
"""Modules of the `hidapi` package in the order they are tried; `hidraw` needs no detaching of kernel drivers."""
_SLICE_MS = 10
_MOST_REPORTS = 256


@dataclass(frozen=True, slots=True)
class HidPort:
    """A HID interface of this machine. path: as its back end opens it."""

    path: str
    back_end: str
    vendor_id: int
    product_id: int
    product: str
    serial_number: str
    interface: int
    usage_page: int
    usage: int


def hid_ports() -> list[HidPort]:
    """The HID interfaces that the first working back end lists."""
    for back_end in BACK_ENDS:
        module = _module(back_end)
        found = [_described(back_end, entry) for entry in module.enumerate()] if module else []
        if found:
            return found
    return []


def matches(port: HidPort, match: HidMatch) -> bool:
    """Whether an interface is what a protocol asks for. Usages and interface numbers count where they are known."""
    return (
        match.vendor_id in (None, port.vendor_id)
        and match.product_id in (None, port.product_id)
        and (match.usage_page is None or port.usage_page == match.usage_page)
        and (match.usage is None or port.usage == match.usage)
        and (match.interface is None or port.interface in (-1, match.interface))
    )


class HidLink(Link):
    """One HID interface: the one at `port`, or the first that any of `wanted` matches."""

    def __init__(self, port: str, wanted: Sequence[HidMatch]) -> None:
        self.where = self._asked = port
        self._wanted = wanted
        self._size = wanted[0].report_size if wanted else 64
        self._serial_number: str | None = None
        self._device: Any = None

    def open(self) -> None:
        self.close()
        port = self._find()
        module = _module(port.back_end)
        device = module.device()  # type: ignore[union-attr]
        try:
            device.open_path(port.path.encode())
            # Otherwise a read without a timeout waits for ever.
            device.set_nonblocking(True)
        except OSError:
            raise DeviceError(
                f"{port.product or 'HID device'} at {port.path} cannot be opened: in use by another program, or no "
                "permission: install devices/60-sixpoint.rules (see docs/devices.md) and plug it in again"
            ) from None
        self.where, self._serial_number, self._device = port.path, port.serial_number, device

    def read(self, timeout_s: float) -> list[bytes]:
        reports = []
        try:
            report = self._read_one(timeout_s)
            while report and len(reports) < _MOST_REPORTS:
                reports.append(report)
                report = bytes(self._opened().read(self._size) or b"")
        except (OSError, ValueError):
            if not reports:
                raise self._lost() from None
        return reports

    def write(self, data: bytes) -> None:
        self._checked(lambda device: device.write(data))

    def send_feature(self, report: bytes) -> None:
        self._checked(lambda device: device.send_feature_report(report))

    def get_feature(self, report_id: int, size: int) -> bytes:
        with contextlib.suppress(OSError, ValueError):
            return bytes(self._opened().get_feature_report(report_id, size) or b"")
        return b""

    def close(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            device.close()

    def _read_one(self, timeout_s: float) -> bytes:
        # hidapi holds the interpreter's lock in no call, but an interrupt only arrives between calls.
        end = time.perf_counter() + timeout_s
        while True:
            left_ms = int(1000 * max(0.0, end - time.perf_counter()))
            report = bytes(self._opened().read(self._size, max(1, min(left_ms, _SLICE_MS))) or b"")
            if report or left_ms <= _SLICE_MS:
                return report

    def _checked(self, send: Any) -> None:
        try:
            sent = send(self._opened())
        except (OSError, ValueError):
            raise self._lost() from None
        if isinstance(sent, int) and sent < 0:
            raise DeviceError(f"{self.where}: the device refuses a report of ours; unplug it and plug it in again")

    def _opened(self) -> Any:
        if self._device is None:
            raise DeviceLost(f"{self.where or 'HID device'}: not open")
        return self._device

    def _lost(self) -> DeviceLost:
        self.close()
        return DeviceLost(f"{self.where}: the device is gone: unplugged or switched off")

    def _find(self) -> HidPort:
        ports = hid_ports()
        if self._asked:
            found = [port for port in ports if port.path == self._asked]
        else:
            found = [port for match in self._wanted for port in ports if matches(port, match)]
            found = [port for port in found if port.serial_number == self._serial_number] or found
        if found:
            return found[0]
        there = ", ".join(sorted({f"{p.product} ({p.vendor_id:04x}:{p.product_id:04x})" for p in ports})) or "none"
        raise DeviceError(f"{self._asked or 'the HID device'} is not here; HID devices here: {there}")


def _module(name: str) -> ModuleType | None:
    try:
        module = importlib.import_module(name)
    except ImportError:
        return None
    # Another package, `hid`, has a module of the same name with another interface.
    return module if hasattr(module, "device") else None


def _described(back_end: str, entry: dict[str, Any]) -> HidPort:
    path = entry["path"]
    return HidPort(
        path.decode(errors="replace") if isinstance(path, bytes) else str(path),
        back_end,
        entry["vendor_id"],
        entry["product_id"],
        entry.get("product_string") or "",
        entry.get("serial_number") or "",
        entry.get("interface_number", -1),
        entry.get("usage_page", 0),
        entry.get("usage", 0),
    )
