"""Serial ports, `socket://host:port` included: the only file that imports pyserial."""

import contextlib
import errno
import glob
import select
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import serial
from serial.tools import list_ports

from devices.errors import DeviceError, DeviceLost
from devices.link import Link
from devices.protocols.protocol import SerialFormat

_LARGEST_READ = 1 << 16
_POLL_S = 0.001
_LOST = (serial.SerialException, OSError, ValueError, TypeError)
"""What pyserial raises when a port vanishes; TypeError comes of its file descriptor being None after a close."""


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port of this machine. usb: (vendor, product, serial number) where it is a USB device's."""

    path: str
    description: str
    usb: tuple[int, int, str] | None


def serial_ports() -> list[SerialPort]:
    """The serial ports that the operating system lists, in the order of their names."""
    return [
        SerialPort(p.device, p.description or "", (p.vid, p.pid, p.serial_number or "") if p.vid is not None else None)
        for p in sorted(list_ports.comports(), key=lambda p: p.device)
    ]


def find_port(asked: str, usb: tuple[int, int, str] | None = None) -> str:
    """The port that is meant: a path, a URL, a pattern such as `/dev/ttyUSB*` (first match), or "" for the only one.

    usb: whose port it was before: the same USB device is found again under another name. Raises DeviceError.
    """
    if "://" in asked or (asked and Path(asked).exists()):
        return asked
    ports = serial_ports()
    if asked in [port.path for port in ports]:
        return asked
    again = [port.path for port in ports if usb is not None and port.usb == usb]
    if again:
        return again[0]
    matches = sorted(glob.glob(asked)) if asked else [port.path for port in ports if port.usb]
    if len(matches) == 1 or (asked and matches):
        return matches[0]
    there = ", ".join(port.path for port in ports) or "none"
    if asked:
        raise DeviceError(f"port {asked} does not exist; ports here: {there}")
    raise DeviceError(f"which port? {'none is a USB adapter' if not matches else 'several could be it'}: {there}")


class SerialLink(Link):
    """One serial port. Missing parity and modem lines, as pseudo-terminals have it, are put up with."""

    def __init__(self, port: str, line: SerialFormat) -> None:
        self.where = self._asked = port
        self._line = self._asked_line = line
        self._usb: tuple[int, int, str] | None = None
        self._port: serial.SerialBase | None = None

    def open(self) -> None:
        self.close()
        self._line = self._asked_line
        self.where = find_port(self._asked, self._usb)
        self._usb = self._usb or next((p.usb for p in serial_ports() if p.path == self.where), None)
        try:
            self._port = _opened(self.where, self._line)
        except (serial.SerialException, OSError, ValueError) as error:
            raise DeviceError(_why_not(self.where, error)) from None

    def read(self, timeout_s: float) -> list[bytes]:
        try:
            port = self._open_port()
            _wait(port, timeout_s)
            data = port.read(_LARGEST_READ)
        except _LOST as error:
            raise self._lost(error) from None
        return [data] if data else []

    def write(self, data: bytes) -> None:
        try:
            self._open_port().write(data)
        except serial.SerialTimeoutException:
            raise DeviceError(f"{self.where}: the device takes no data; check the cable and its flow control") from None
        except _LOST as error:
            raise self._lost(error) from None

    def close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(*_LOST):
                port.close()

    def set_baud(self, baud: int) -> None:
        self._line = replace(self._line, baud=baud)
        with contextlib.suppress(serial.SerialException, OSError, ValueError):
            self._open_port().baudrate = baud

    def set_rts(self, on: bool) -> None:
        with contextlib.suppress(serial.SerialException, OSError):
            self._open_port().rts = on

    def send_break(self, seconds: float) -> None:
        with contextlib.suppress(serial.SerialException, OSError, NotImplementedError):
            self._open_port().send_break(seconds)

    def _open_port(self) -> serial.SerialBase:
        if self._port is None:
            raise DeviceLost(f"{self.where}: the port is not open")
        return self._port

    def _lost(self, error: BaseException) -> DeviceLost:
        if isinstance(error, DeviceLost):
            return error
        self.close()
        return DeviceLost(f"{self.where}: the device is gone: unplugged, switched off, or closed at its end")


def _opened(where: str, line: SerialFormat) -> serial.SerialBase:
    def attempt(line: SerialFormat) -> serial.SerialBase:
        return serial.serial_for_url(
            where,
            baudrate=line.baud,
            bytesize=line.data_bits,
            parity=line.parity,
            stopbits=line.stop_bits,
            rtscts=line.rtscts,
            timeout=0,
            write_timeout=1.0,
            exclusive=True,
        )

    try:
        port = attempt(line)
    except Exception as error:  # termios.error is no OSError
        if _number(error) != errno.EINVAL or line.parity == "N":
            raise error if isinstance(error, OSError | ValueError) else OSError(*error.args) from None
        port = attempt(replace(line, parity="N", data_bits=8))
    with contextlib.suppress(AttributeError, ValueError, OSError, NotImplementedError):
        # USB adapters otherwise hold bytes back for 16 ms.
        port.set_low_latency_mode(True)  # type: ignore[attr-defined]
    return port


def _wait(port: serial.SerialBase, timeout_s: float) -> None:
    """Until there are bytes, at most `timeout_s`."""
    if sys.platform != "win32":
        select.select([port.fileno()], [], [], max(0.0, timeout_s))
        return
    end = time.perf_counter() + timeout_s
    while not port.in_waiting and time.perf_counter() < end:
        time.sleep(_POLL_S)


def _number(error: BaseException) -> int | None:
    if isinstance(error, OSError) and error.errno:
        return error.errno
    return error.args[0] if error.args and isinstance(error.args[0], int) else None


def _why_not(where: str, error: BaseException) -> str:
    """One line: why a port does not open, and what would mend it."""
    number = _number(error)
    if "://" in where:
        return f"{where}: no connection ({error}); check host and port, as in socket://192.168.1.20:4001"
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV) or "FileNotFoundError" in str(error):
        there = ", ".join(port.path for port in serial_ports()) or "none"
        return f"port {where} does not exist; ports here: {there}"
    if number == errno.EACCES:
        return f"port {where}: no permission; run sudo usermod -aG dialout $USER and log in anew"
    if Path(where).is_dir() or Path(where).is_file():
        return f"{where} is no serial port; ports here: {', '.join(port.path for port in serial_ports()) or 'none'}"
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in str(error):
        return f"port {where} is in use by another program; close it first"
    return f"port {where} cannot be opened: {error}"
