"""A device on a link: the driver that every serial and HID tracker shares."""

import time
from collections.abc import Mapping

from devices.driver import RawChunk, Reading
from devices.errors import DeviceError
from devices.link import Link, run_script
from devices.protocols.protocol import DeviceProtocol

_POLL_S = 0.01
"""Longest wait between two looks at what a polled protocol wants to send."""


class LinkedDevice:
    """`Driver` over a link and a protocol. An empty raw chunk is given after each `open`: the stream starts there."""

    def __init__(self, name: str, link: Link, protocol: DeviceProtocol) -> None:
        self.name = name
        self.link = link
        self.protocol = protocol
        self._just_opened = False

    @property
    def role_hints(self) -> Mapping[str, str]:
        """Tracker -> role as the device itself says it, empty mostly; known once it is open."""
        return self.protocol.role_hints

    def open(self) -> None:
        """Opens the link and brings the device to streaming. Raises DeviceError with what to check."""
        self.link.open()
        try:
            run_script(self.link, self.protocol.start())
        except BaseException:
            self.link.close()
            raise
        self.protocol.reset()
        self._just_opened = True

    def read(self, timeout_s: float) -> Reading:
        """What came since the last call, waiting at most `timeout_s` for the first of it."""
        if self._just_opened:
            self._just_opened = False
            return Reading((RawChunk(time.perf_counter_ns(), b""),))
        end = time.perf_counter() + timeout_s
        while True:
            left = end - time.perf_counter()
            pieces = self.link.read(max(0.0, min(left, _POLL_S)))
            now_ns = time.perf_counter_ns()
            samples = [sample for piece in pieces for sample in self.protocol.feed(piece, now_ns)]
            self._request(now_ns, bool(pieces))
            if pieces or left <= 0:
                return Reading(tuple(RawChunk(now_ns, piece) for piece in pieces), tuple(samples))

    def _request(self, now_ns: int, something_to_give: bool) -> None:
        """Sends what a polled protocol wants to. A device that is lost meanwhile is so at the next read: what has come
        is given first."""
        request = self.protocol.to_send(now_ns)
        if request:
            try:
                self.link.write(request)
            except DeviceError:
                if not something_to_give:
                    raise

    def recover(self) -> None:
        """The device is silent though its port is there: does what its protocol knows for that."""
        run_script(self.link, self.protocol.recover())
        self.protocol.reset()
        self._just_opened = True

    def close(self) -> None:
        """Leaves the device quiet, where it still listens, and closes the link."""
        try:
            run_script(self.link, self.protocol.stop())
        except DeviceError:  # one that is gone cannot be told
            pass
        finally:
            self.link.close()
