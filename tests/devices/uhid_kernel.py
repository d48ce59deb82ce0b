"""A stand-in for the kernel behind `/dev/uhid`, which reads the messages at the header's offsets by itself."""

import socket
import struct
import threading
from pathlib import Path

from devices.link import Link
from devices.simulators.uhid_events import DATA_MAX, EVENT_SIZE, EventType, HidIdentity, ReportType


def created(message: bytes) -> HidIdentity:
    """What the kernel makes of CREATE2, read field by field at the header's offsets."""
    message = message.ljust(EVENT_SIZE, b"\0")
    assert struct.unpack_from("=I", message, 0)[0] == EventType.CREATE2
    size, bus, vendor_id, product_id = struct.unpack_from("=HHII", message, 260)
    assert bus == 3
    name, unique = (message[at : at + length].split(b"\0")[0].decode() for at, length in ((4, 128), (196, 64)))
    return HidIdentity(name, unique, vendor_id, product_id, message[280 : 280 + size])


def get_report(request: int, report_id: int, kind: int = ReportType.FEATURE) -> bytes:
    return struct.pack("=IIBB", 9, request, report_id, kind).ljust(EVENT_SIZE, b"\0")


def set_report(request: int, data: bytes, kind: int = ReportType.FEATURE) -> bytes:
    return (struct.pack("=IIBBH", 13, request, data[0], kind, len(data)) + data).ljust(EVENT_SIZE, b"\0")


def output(data: bytes) -> bytes:
    return (struct.pack("=I", 6) + data.ljust(DATA_MAX, b"\0") + struct.pack("=HB", len(data), 1)).ljust(EVENT_SIZE)


class FakeKernel(Link):
    """The kernel and a host's hidraw link to it: parses what the device writes, asks as the host wants.

    Every plug is a new socket pair, whose messages keep their borders as those of `/dev/uhid` do.
    """

    def __init__(self, folder: Path) -> None:
        self.where, self.nodes = "fake", folder
        self.identity: HidIdentity | None = None
        self.destroyed = 0
        self.requests = 0
        self.errors: list[int] = []
        self._reports: list[bytes] = []
        self._socket: socket.socket | None = None

    @property
    def ready(self) -> bool:
        """Whether the device has been made."""
        return self.identity is not None

    def descriptor(self) -> int:
        """What opening `/dev/uhid` gives."""
        kernel, device = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        kernel.settimeout(5.0)
        self._close_socket()
        self._socket = kernel
        threading.Thread(target=self._make_node, daemon=True).start()
        return device.detach()

    def _make_node(self) -> None:
        self.identity = created(self._receive())
        (self.nodes / "hidraw7" / "device").mkdir(parents=True, exist_ok=True)
        uevent = f"DRIVER=hid-generic\nHID_NAME={self.identity.product}\nHID_UNIQ={self.identity.unique}\n"
        (self.nodes / "hidraw7" / "device" / "uevent").write_text(uevent)
        self._tell(struct.pack("=IQ", 2, 0))

    def open(self) -> None:
        self._tell(struct.pack("=I", 4))

    def close(self) -> None:
        self._tell(struct.pack("=I", 5))

    def read(self, timeout_s: float) -> list[bytes]:
        assert self._socket is not None
        self._socket.settimeout(max(timeout_s, 0.001))
        try:
            self._take(self._receive())
        except TimeoutError:
            pass
        finally:
            self._socket.settimeout(5.0)
        reports, self._reports = self._reports, []
        return reports

    def write(self, data: bytes) -> None:
        self._tell(output(data))

    def send_feature(self, report: bytes) -> None:
        self.requests += 1
        self._tell(set_report(self.requests, report))
        self.errors.append(struct.unpack_from("=H", self._reply(14), 8)[0])

    def get_feature(self, report_id: int, size: int) -> bytes:
        self.requests += 1
        self._tell(get_report(self.requests, report_id))
        reply = self._reply(10)
        error, length = struct.unpack_from("=HH", reply, 8)
        self.errors.append(error)
        return reply[12 : 12 + length][:size]

    def take_all(self) -> None:
        """Reads until the device has closed its end."""
        while message := self._receive():
            self._take(message)

    def _reply(self, kind: int) -> bytes:
        while True:
            message = self._receive()
            if struct.unpack_from("=I", message)[0] == kind:
                assert struct.unpack_from("=I", message, 4)[0] == self.requests
                return message
            self._take(message)

    def _take(self, message: bytes) -> None:
        if not message:
            return
        (kind,) = struct.unpack_from("=I", message)
        if kind == EventType.INPUT2:
            (size,) = struct.unpack_from("=H", message, 4)
            assert len(message) == 6 + size
            self._reports.append(message[6:])
        else:
            assert kind == EventType.DESTROY
            self.destroyed += 1

    def _receive(self) -> bytes:
        assert self._socket is not None
        try:
            return self._socket.recv(EVENT_SIZE)
        except ConnectionResetError:  # the other end left messages of ours unread; what it wrote is still there
            return self._socket.recv(EVENT_SIZE)

    def _tell(self, message: bytes) -> None:
        assert self._socket is not None
        self._socket.send(message.ljust(EVENT_SIZE, b"\0"))

    def _close_socket(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def end(self) -> None:
        self._close_socket()
