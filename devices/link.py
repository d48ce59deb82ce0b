"""What carries bytes between a device and us, and the running of a protocol's scripts over it."""

import time
from abc import ABC, abstractmethod

from devices.protocols.protocol import (
    Break,
    Drain,
    GetFeature,
    Pause,
    Receive,
    Script,
    SendFeature,
    SetBaud,
    SetRts,
    Step,
    Write,
)


class Link(ABC):
    """One port. `open` and `write` raise DeviceError, everything raises DeviceLost when the device is gone."""

    where: str
    """The port as users know it, for messages."""

    @abstractmethod
    def open(self) -> None:
        """Opens the port, ready to read; an open port is closed first."""

    @abstractmethod
    def read(self, timeout_s: float) -> list[bytes]:
        """What has come, waiting at most `timeout_s` for the first of it. Serial: one piece; HID: whole reports."""

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Sends bytes (serial) or an output report (HID)."""

    @abstractmethod
    def close(self) -> None:
        """Closes the port; does nothing where it is closed."""

    def set_baud(self, baud: int) -> None:  # noqa: B027 - only serial ports have one
        """Changes the line's speed."""

    def set_rts(self, on: bool) -> None:  # noqa: B027
        """Drives the RTS line, where there is one."""

    def send_break(self, seconds: float) -> None:  # noqa: B027
        """Sends a BREAK, where there is one."""

    def send_feature(self, report: bytes) -> None:  # noqa: B027
        """Sends a HID feature report."""

    def get_feature(self, report_id: int, size: int) -> bytes:
        """Reads a HID feature report, b"" where the device has none."""
        return b""


def run_script(link: Link, script: Script) -> None:
    """Carries out a protocol's script on an open link. Raises what the script raises, and the link's errors."""
    reply = None
    while True:
        try:
            step = next(script) if reply is None else script.send(reply)
        except StopIteration:
            return
        reply = _do(link, step)


def _do(link: Link, step: Step) -> bytes:
    match step:
        case Write(data):
            link.write(data)
        case Receive():
            return _receive(link, step)
        case Drain():
            _drain(link, step)
        case Pause(seconds):
            time.sleep(seconds)
        case SetBaud(baud):
            link.set_baud(baud)
        case SetRts(on):
            link.set_rts(on)
        case Break(seconds):
            link.send_break(seconds)
        case SendFeature(report):
            link.send_feature(report)
        case GetFeature(report_id, size):
            return link.get_feature(report_id, size)
    return b""


def _receive(link: Link, step: Receive) -> bytes:
    received = b""
    end = time.perf_counter() + step.timeout_s
    while (left := end - time.perf_counter()) > 0:
        received += b"".join(link.read(left))
        if (step.until and step.until in received) or (step.size and len(received) >= step.size):
            break
    return received


def _drain(link: Link, step: Drain) -> None:
    end = time.perf_counter() + step.timeout_s
    while (left := end - time.perf_counter()) > 0:
        if not link.read(min(left, step.silence_s)):
            return
