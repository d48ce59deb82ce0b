"""A device that is looked after: taken up again by itself when it comes back, woken when it falls silent."""

import time
from collections.abc import Callable
from enum import Enum

from devices.driver import Driver, Reading
from devices.errors import DeviceError, DeviceLost

RETRY_S = 0.5
"""How often a device that is gone is looked for: well within the two seconds in which it must be back."""


class DeviceState(Enum):
    """What a looked-after device is doing."""

    STREAMING = "streaming"
    SILENT = "silent"
    """Its port is there and nothing comes of it."""
    GONE = "gone"


class ReconnectingDevice:
    """`Driver` whose `read` never raises: a device that is lost gives nothing until it is back.

    tell: called with one line whenever its state changes. silent_s: how long without a sample counts as silent; its
    protocol's recovery is tried then, and again each time that long has passed.
    """

    def __init__(self, driver: Driver, tell: Callable[[str], None] = lambda _: None, silent_s: float = 1.0) -> None:
        self.driver = driver
        self.name = driver.name
        self.state = DeviceState.GONE
        self._tell = tell
        self._silent_s = silent_s
        self._heard = self._tried = 0.0
        self._last_error = ""

    def open(self) -> None:
        """Opens the device. Raises DeviceError: a device that is not there at the start is the user's to mend."""
        self.driver.open()
        self._now_streaming()

    def read(self, timeout_s: float) -> Reading:
        """As the device's own, but nothing where it is gone."""
        if self.state is DeviceState.GONE and not self._reopened(timeout_s):
            return Reading()
        try:
            reading = self.driver.read(timeout_s)
            self._watch(reading)
        except DeviceError as error:
            self._lose(error)
            return Reading()
        return reading

    def close(self) -> None:
        """Closes the device."""
        self.driver.close()
        self.state = DeviceState.GONE

    def _reopened(self, timeout_s: float) -> bool:
        now = time.perf_counter()
        if now - self._tried < RETRY_S:
            time.sleep(min(timeout_s, RETRY_S - (now - self._tried)))
            return False
        try:
            self.driver.open()
        except DeviceError:
            self._tried = time.perf_counter()
            return False
        self._tell(f"{self.name}: back")
        self._now_streaming()
        return True

    def _watch(self, reading: Reading) -> None:
        now = time.perf_counter()
        if reading.samples:
            if self.state is DeviceState.SILENT:
                self._tell(f"{self.name}: streaming again")
                self.state = DeviceState.STREAMING
            self._heard = self._tried = now
        elif now - self._tried > self._silent_s:
            if self.state is DeviceState.STREAMING:
                self._tell(f"{self.name}: silent for {now - self._heard:.1f} s; trying to wake it")
                self.state = DeviceState.SILENT
            try:
                getattr(self.driver, "recover", lambda: None)()
            finally:
                self._tried = time.perf_counter()

    def _lose(self, error: DeviceError) -> None:
        if isinstance(error, DeviceLost):
            self._tell(f"{error}; looking for it")
            self.state = DeviceState.GONE
            self._tried = time.perf_counter() - RETRY_S
        elif str(error) != self._last_error:
            self._tell(str(error))
        self._last_error = str(error)

    def _now_streaming(self) -> None:
        self.state, self._last_error = DeviceState.STREAMING, ""
        self._heard = self._tried = time.perf_counter()
