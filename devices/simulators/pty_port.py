"""A pseudo-terminal that can be unplugged and plugged in again."""

import contextlib
import os
import select
import time
from pathlib import Path

from devices.errors import DeviceError


class PtyPort:
    """The device's end of a pseudo-terminal; the host opens `path` like any serial port.

    link: a symbolic link kept pointing at the host's end, so that the port has one name however often it is replugged.
    Raises DeviceError where the system has no pseudo-terminals (Windows) or the link cannot be made.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._link = link
        self._master: int | None = None
        self.path = ""
        self.plug()

    def plug(self) -> None:
        """Makes the port appear, under a name of the system's choosing."""
        self.unplug()
        try:
            import tty

            self._master, slave = os.openpty()
        except (ImportError, AttributeError, OSError):
            raise DeviceError(
                "no pseudo-terminal can be made here: simulate on Linux or macOS, or serve socket://"
            ) from None
        # Raw, so that nothing we write before the host opens the port comes back as an echo.
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        # Once it has been opened and closed, poll tells whether a host has it open.
        os.close(slave)
        os.set_blocking(self._master, False)
        try:
            self._point_link()
        except DeviceError:
            os.close(self._master)
            self._master = None
            raise

    def unplug(self) -> None:
        """Makes the port vanish under the host's hands."""
        master, self._master = self._master, None
        if master is not None:
            os.close(master)
        if self._link is not None and self._link.is_symlink():
            self._link.unlink()

    @property
    def host_is_there(self) -> bool:
        """Whether somebody has the port open."""
        return self._master is not None and not self._poll(select.POLLOUT, 0.0) & select.POLLHUP

    def wait(self, timeout_s: float) -> None:
        """Until the host has written something, at most `timeout_s`."""
        if not self.host_is_there or not self._poll(select.POLLIN, timeout_s):
            time.sleep(timeout_s)

    def read(self) -> bytes:
        """What the host has written by now."""
        if self._master is not None:
            with contextlib.suppress(OSError):
                return os.read(self._master, 4096)
        return b""

    def write(self, data: bytes, patience_s: float = 0.0) -> int:
        """Sends to the host as much as goes within `patience_s`; the rest is lost. Returns the bytes sent."""
        sent = 0
        while self._master is not None and sent < len(data):
            with contextlib.suppress(BlockingIOError):
                sent += os.write(self._master, data[sent:])
                continue
            events = self._poll(select.POLLOUT, patience_s)
            if not events & select.POLLOUT or events & select.POLLHUP:
                break
        return sent

    def _poll(self, events: int, timeout_s: float) -> int:
        master = self._master
        if master is None:
            return 0
        poll = select.poll()
        poll.register(master, events)
        return next((found for _, found in poll.poll(1000 * timeout_s)), 0)

    def _point_link(self) -> None:
        if self._link is None:
            return
        if self._link.exists() and not self._link.is_symlink():
            raise DeviceError(f"{self._link}: there is a file already; give the simulated port another name")
        try:
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(self.path)
        except OSError as error:
            raise DeviceError(
                f"{self._link}: the port's name cannot be made ({error.strerror}); give it another, in a folder "
                "that is there and can be written to"
            ) from None
