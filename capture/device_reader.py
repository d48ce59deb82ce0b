"""One thread a device: reads it until it is told to stop. The only place where device threads meet the session."""

import queue
import threading
from dataclasses import dataclass

from devices.driver import Driver, Reading

_READ_S = 0.05


@dataclass(frozen=True, slots=True)
class Arrival:
    """Something a device brought: its number in the session, and the reading."""

    device: int
    reading: Reading


class DeviceReader(threading.Thread):
    """Reads one open driver into `inbox`; the driver is one that looks after itself (`devices.reconnecting`)."""

    def __init__(self, number: int, driver: Driver, inbox: "queue.SimpleQueue[Arrival]") -> None:
        super().__init__(name=f"read {driver.name}", daemon=True)
        self._number, self._driver, self._inbox = number, driver, inbox
        self._stopping = threading.Event()

    def run(self) -> None:
        """The thread's body."""
        try:
            while not self._stopping.is_set():
                reading = self._driver.read(_READ_S)
                if reading.chunks or reading.samples:
                    self._inbox.put(Arrival(self._number, reading))
        finally:
            self._driver.close()

    def stop(self) -> None:
        """Ends the reading, closes the driver and waits for both."""
        self._stopping.set()
        if self.is_alive():
            self.join(timeout=5)
