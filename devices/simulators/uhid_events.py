"""The messages of Linux's `uhid`, by which a program is a HID device: pure packing and unpacking.

Source: linux/uhid.h and Documentation/hid/uhid.rst. Every message is a u32 type and a packed payload, in the machine's
byte order; one read or write is one message, and what a short one lacks is 0. Report data has the report's ID first,
0 from the host where reports have none.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

DATA_MAX = 4096
EVENT_SIZE = 4380
"""Bytes of the kernel's struct, 4 more than its longest message, `CREATE2`, has: what one read asks for."""
BUS_USB = 3
EIO = 5

_TYPE = struct.Struct("=I")
_CREATE2 = struct.Struct("=I128s64s64sHHIIII")
_INPUT2 = struct.Struct("=IH")
_OUTPUT = struct.Struct(f"=I{DATA_MAX}sHB")
_GET_REPORT = struct.Struct("=IIBB")
_GET_REPORT_REPLY = struct.Struct("=IIHH")
_SET_REPORT = struct.Struct("=IIBBH")
_SET_REPORT_REPLY = struct.Struct("=IIH")


class EventType(IntEnum):
    """The types in use; the missing numbers are obsolete."""

    DESTROY = 1
    START = 2
    STOP = 3
    OPEN = 4
    CLOSE = 5
    OUTPUT = 6
    GET_REPORT = 9
    GET_REPORT_REPLY = 10
    CREATE2 = 11
    INPUT2 = 12
    SET_REPORT = 13
    SET_REPORT_REPLY = 14


class ReportType(IntEnum):
    """What kind of report a request is about."""

    FEATURE = 0
    OUTPUT = 1
    INPUT = 2


@dataclass(frozen=True, slots=True)
class HidIdentity:
    """What a HID device tells of itself. unique: its serial number; at most 127 and 63 bytes of names are kept."""

    product: str
    unique: str
    vendor_id: int
    product_id: int
    report_descriptor: bytes


@dataclass(frozen=True, slots=True)
class HostEvent:
    """What the kernel says. request: to be repeated in the reply; data: of OUTPUT and SET_REPORT."""

    type: int
    request: int = 0
    report_id: int = 0
    report_type: int = ReportType.FEATURE
    data: bytes = b""


def unpack(message: bytes) -> HostEvent:
    """The kernel's message; one of a type that is not known, or that needs nothing, has its type only."""
    message = message.ljust(EVENT_SIZE, b"\0")
    (kind,) = _TYPE.unpack_from(message)
    if kind == EventType.OUTPUT:
        _, data, size, report_type = _OUTPUT.unpack_from(message)
        return HostEvent(kind, report_id=data[0], report_type=report_type, data=data[:size])
    if kind == EventType.GET_REPORT:
        _, request, report_id, report_type = _GET_REPORT.unpack_from(message)
        return HostEvent(kind, request, report_id, report_type)
    if kind == EventType.SET_REPORT:
        _, request, report_id, report_type, size = _SET_REPORT.unpack_from(message)
        start = _SET_REPORT.size
        return HostEvent(kind, request, report_id, report_type, message[start : start + min(size, DATA_MAX)])
    return HostEvent(kind)


def pack_create(identity: HidIdentity) -> bytes:
    """The device appears, on the USB bus."""
    descriptor = identity.report_descriptor
    return _CREATE2.pack(
        EventType.CREATE2, identity.product.encode()[:127], b"sixpoint", identity.unique.encode()[:63],
        len(descriptor), BUS_USB, identity.vendor_id, identity.product_id, 0, 0,
    ) + descriptor  # fmt: skip


def pack_destroy() -> bytes:
    """The device vanishes."""
    return _TYPE.pack(EventType.DESTROY)


def pack_input(report: bytes) -> bytes:
    """The device sends an input report."""
    return _INPUT2.pack(EventType.INPUT2, len(report)) + report


def pack_get_report_reply(request: int, report: bytes) -> bytes:
    """The report that was asked for; b"" is that there is none, an error for the host."""
    error = 0 if report else EIO
    return _GET_REPORT_REPLY.pack(EventType.GET_REPORT_REPLY, request, error, len(report)) + report


def pack_set_report_reply(request: int, accepted: bool) -> bytes:
    """The report has been taken, or not: an error for the host."""
    return _SET_REPORT_REPLY.pack(EventType.SET_REPORT_REPLY, request, 0 if accepted else EIO)
