"""A HID device of the kernel's that is played by this program, through Linux's `/dev/uhid`."""

import contextlib
import os
import select
import time
from collections.abc import Callable
from pathlib import Path

from devices.errors import DeviceError
from devices.simulators import uhid_events
from devices.simulators.uhid_events import EventType, HidIdentity, HostEvent

UHID = Path("/dev/uhid")
HIDRAW = Path("/sys/class/hidraw")
_NODE_PATIENCE_S = 2.0
"""How long the kernel has to make the device's node."""


def open_uhid() -> int:
    """A descriptor of `/dev/uhid`. Raises DeviceError with what would help where there is none for us."""
    try:
        return os.open(UHID, os.O_RDWR)
    except PermissionError:
        raise DeviceError(
            f"a HID device is simulated through {UHID}, which you may not write to: run as root, or give yourself the "
            f"right: sudo setfacl -m u:$USER:rw {UHID}"
        ) from None
    except OSError as error:
        raise DeviceError(
            f"a HID device is simulated through Linux's {UHID}, which cannot be opened here ({error.strerror}): "
            "try sudo modprobe uhid, on a kernel that has it"
        ) from None


class UhidPort:
    """The device's end; the host finds the device by its numbers, or opens `path`.

    open_descriptor: what gives the descriptor. nodes: the kernel's list of hidraw nodes. Raises DeviceError where there
    is no uhid that may be written to, or it refuses the device.
    """

    def __init__(
        self, identity: HidIdentity, open_descriptor: Callable[[], int] = open_uhid, nodes: Path = HIDRAW
    ) -> None:
        self._identity, self._open, self._nodes = identity, open_descriptor, nodes
        self._descriptor: int | None = None
        self.host_is_there = False
        """Whether somebody has the device open, as far as the kernel's messages were read."""
        self.plug()

    @property
    def path(self) -> str:
        """The hidraw node, waited for. Raises DeviceError where the kernel makes none."""
        end = time.perf_counter() + _NODE_PATIENCE_S
        while time.perf_counter() < end:
            for node in self._nodes.glob("hidraw*"):
                with contextlib.suppress(OSError):
                    if f"HID_UNIQ={self._identity.unique}" in (node / "device" / "uevent").read_text().splitlines():
                        return f"/dev/{node.name}"
            time.sleep(0.01)
        raise DeviceError(f"the kernel makes no hidraw node of the {self._identity.product}: has it hidraw?")

    def plug(self) -> None:
        """Makes the device appear."""
        self.unplug()
        descriptor = self._open()
        os.set_blocking(descriptor, False)
        try:
            os.write(descriptor, uhid_events.pack_create(self._identity))
        except OSError as error:
            os.close(descriptor)
            raise DeviceError(f"{UHID} refuses the {self._identity.product}: {error.strerror}") from None
        self._descriptor = descriptor

    def unplug(self) -> None:
        """Makes the device vanish under the host's hands."""
        self.write(uhid_events.pack_destroy())
        descriptor, self._descriptor = self._descriptor, None
        self.host_is_there = False
        if descriptor is not None:
            os.close(descriptor)

    def wait(self, timeout_s: float) -> None:
        """Until the kernel has a message, at most `timeout_s`."""
        descriptor = self._descriptor
        if descriptor is None:
            time.sleep(timeout_s)
            return
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        if any(events & ~select.POLLIN for _, events in poll.poll(1000 * timeout_s)):
            time.sleep(timeout_s)

    def read(self) -> HostEvent | None:
        """The kernel's next message, if there is one by now."""
        if self._descriptor is None:
            return None
        message = b""
        with contextlib.suppress(OSError):
            message = os.read(self._descriptor, uhid_events.EVENT_SIZE)
        if not message:
            return None
        event = uhid_events.unpack(message)
        if event.type in (EventType.OPEN, EventType.CLOSE, EventType.STOP):
            self.host_is_there = event.type == EventType.OPEN
        return event

    def write(self, message: bytes) -> bool:
        """Tells the kernel; whether it took the message."""
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                return os.write(self._descriptor, message) == len(message)
        return False
