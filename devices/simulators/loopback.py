"""A link straight into a simulated device, without any port: for recordings and tests that need no real time."""

from collections.abc import Callable

from devices.errors import DeviceLost
from devices.link import Link
from devices.protocols.protocol import SimulatedDevice


class LoopbackLink(Link):
    """The host's end. What the device says on its own is put in with `deliver`; `unplug` makes it vanish.

    streamed: called when there is nothing to read, for packets that a device streams while it is being started.
    """

    def __init__(
        self, device: SimulatedDevice, where: str = "loopback", streamed: Callable[[], list[bytes]] = list
    ) -> None:
        self.where = where
        self.streamed = streamed
        self._device = device
        self._inbox: list[bytes] = []
        self._there = True

    def deliver(self, packets: list[bytes]) -> None:
        """The device sends these packets (HID: reports)."""
        self._inbox += packets

    def unplug(self, there: bool = False) -> None:
        """Pulls the cable out; True puts it back."""
        self._there = there
        self._inbox.clear()

    def open(self) -> None:
        self._check()

    def read(self, timeout_s: float) -> list[bytes]:
        self._check()
        packets, self._inbox = self._inbox or self.streamed(), []
        return packets

    def write(self, data: bytes) -> None:
        self._check()
        reply = self._device.answer(data)
        if reply:
            self._inbox.append(reply)

    def send_feature(self, report: bytes) -> None:
        self._check()
        self._device.set_feature(report)

    def get_feature(self, report_id: int, size: int) -> bytes:
        self._check()
        return self._device.get_feature(report_id, size)

    def close(self) -> None:
        """Nothing to let go of."""

    def _check(self) -> None:
        if not self._there:
            raise DeviceLost(f"{self.where}: the device is gone")
