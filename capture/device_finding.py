"""Which trackers are plugged in: HID devices by their numbers, serial ones by listening to their ports."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from devices.errors import DeviceError
from devices.hid_link import hid_ports, matches
from devices.progress import Progress, no_progress
from devices.protocols import make_protocol, protocols
from devices.protocols.protocol import DeviceProtocol, SerialFormat
from devices.serial_link import SerialLink, SerialPort, serial_ports

_LISTEN_S = 0.7
_READ_S = 0.02
_FEWEST_SAMPLES = 3


@dataclass(frozen=True)
class FoundDevice:
    """A port with what speaks there. protocol: its name, or "" where nothing was heard; title: in words."""

    port: str
    protocol: str
    title: str


def find_devices(progress: Progress = no_progress) -> list[FoundDevice]:
    """HID trackers, then every USB serial port, with the protocol that makes sense of what comes there by itself.

    Nothing is sent: who knows what else is plugged in. A device that waits to be asked stays without a protocol.
    """
    known = protocols()
    found = [
        FoundDevice(port.path, p.name, p.title)
        for port in hid_ports()
        for p in known.values()
        if any(matches(port, match) for match in p.hid)
    ]
    ports = [port for port in serial_ports() if port.usb is not None]
    for number, port in enumerate(ports):
        found.append(_listened(port))
        progress(number + 1, len(ports))
    return found


def _listened(port: SerialPort) -> FoundDevice:
    heard = heard_protocol(port.path)
    words = protocols()[heard].title if heard else port.description or "a serial port"
    return FoundDevice(port.path, heard, words)


def heard_protocol(port: str, listen_s: float = _LISTEN_S) -> str:
    """The protocol that most of what comes from a serial port belongs to, or "" where none fits or the port is busy."""
    best, most = "", 0.0
    for line, names in _by_line().items():
        try:
            data = _heard(port, line, listen_s)
        except DeviceError:
            return ""
        for name in names if data else ():
            good = _share_understood(make_protocol(name), data)
            if good > most:
                best, most = name, good
    return best


def _by_line() -> Mapping[SerialFormat, Sequence[str]]:
    """The serial protocols by how their line is set, so that each setting is listened to once."""
    lines: dict[SerialFormat, list[str]] = {}
    for name, protocol in protocols().items():
        if protocol.link == "serial":
            lines.setdefault(make_protocol(name).serial, []).append(name)
    return lines


def _heard(port: str, line: SerialFormat, listen_s: float) -> bytes:
    link, pieces = SerialLink(port, line), []
    link.open()
    try:
        end = time.perf_counter() + listen_s
        while time.perf_counter() < end:
            pieces += link.read(_READ_S)
    finally:
        link.close()
    return b"".join(pieces)


def _share_understood(protocol: DeviceProtocol, data: bytes) -> float:
    """How much of the bytes were good frames, 0 to 1; 0 for too few samples to tell."""
    samples = protocol.feed(data, time.perf_counter_ns())
    bad = protocol.counters.bytes_dropped
    return max(0.0, 1 - bad / len(data)) if len(samples) >= _FEWEST_SAMPLES else 0.0
