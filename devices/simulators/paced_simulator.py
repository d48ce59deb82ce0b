"""Plays a simulated device on some port, in time: what pseudo-terminals and virtual HID devices share."""

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable
from types import TracebackType
from typing import Protocol, Self

from devices.protocols.protocol import SimulatedDevice
from devices.sample import TrackerSample

IDLE_S = 0.02
"""How often a host that is not there is looked for."""
_PATIENCE_S = 5.0
"""How long a device that sends as fast as it can waits for the host to read."""
_REAL_TIME_PATIENCE_S = 0.25
"""How long one in real time does: a host on a busy machine reads late. Then bytes are lost, as on a cable."""


class SimulatedPort(Protocol):
    """The device's end of a port that can be unplugged and plugged in again."""

    @property
    def path(self) -> str:
        """What the host opens."""
        ...

    @property
    def host_is_there(self) -> bool:
        """Whether somebody has the port open."""
        ...

    def plug(self) -> None:
        """Makes the port appear."""

    def unplug(self) -> None:
        """Makes the port vanish under the host's hands."""

    def wait(self, timeout_s: float) -> None:
        """Until the host has said something, at most `timeout_s`."""


class PacedSimulator(ABC):
    """Runs a simulated device on a port, in a thread of its own, until its source ends or `close`.

    source: (seconds since start, samples of all trackers), as `measurements` gives them. The motion begins when a host
    has opened the port, and has started the device where it begins quiet. pace: 1 is real time, None as fast as the
    host reads. Use as a context manager. Subclasses set up what `_converse` and `_put` need before `__init__` of this.
    """

    def __init__(
        self,
        device: SimulatedDevice,
        source: Iterable[tuple[float, list[TrackerSample]]],
        port: SimulatedPort,
        *,
        pace: float | None,
    ) -> None:
        self._device, self._source, self._port, self._pace = device, source, port, pace
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._stalled = threading.Event()
        self.started = threading.Event()
        """Set when the motion begins: a host is there, and has started the device where it must."""
        self.finished = threading.Event()
        """Set when the source has ended."""
        self.bytes_sent = 0
        self.samples_sent = 0
        self._thread = threading.Thread(target=self._run, name="simulated device", daemon=True)
        self._thread.start()

    @abstractmethod
    def _converse(self) -> bool:
        """Reads what the host says by now and answers, unless stalled; whether there was something."""

    @abstractmethod
    def _put(self, packet: bytes, patience_s: float) -> int:
        """Sends a packet, waiting at most that long for the host; returns the bytes sent."""

    @property
    def path(self) -> str:
        """The port for the host to open; another one after `replug`."""
        return self._port.path

    @property
    def stalled(self) -> bool:
        """Whether the device hangs."""
        return self._stalled.is_set()

    def unplug(self) -> None:
        """Pulls the cable out."""
        with self._lock:
            self._port.unplug()

    def replug(self) -> str:
        """Puts the cable back; the port may have another name, which is returned."""
        with self._lock:
            self._port.plug()
        return self.path

    def stall(self, stalled: bool = True) -> None:
        """The device hangs: the port is there and nothing comes; False wakes it."""
        (self._stalled.set if stalled else self._stalled.clear)()

    def close(self) -> None:
        """Stops the device and removes the port."""
        self._closing.set()
        self._thread.join()
        self._port.unplug()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _run(self) -> None:
        while not self._closing.is_set() and not (self._port.host_is_there and self._device.streaming):
            self._listen(IDLE_S)
        self.started.set()
        start = time.perf_counter()
        for time_s, samples in self._source:
            self._listen_until(start + time_s / self._pace if self._pace else 0.0)
            if self._closing.is_set():
                return
            self._send(samples)
        self.finished.set()
        while not self._closing.is_set():
            self._listen(IDLE_S)

    def _listen_until(self, moment: float) -> None:
        while True:
            left = moment - time.perf_counter()
            self._listen(min(max(left, 0.0), IDLE_S))
            if left <= IDLE_S or self._closing.is_set():
                return

    def _listen(self, timeout_s: float) -> None:
        """Answers the host for as long as that, not much longer."""
        end = time.perf_counter() + timeout_s
        while True:
            with self._lock:
                heard = self._converse()
            left = end - time.perf_counter()
            if left <= 0 or self._closing.is_set():
                return
            if not heard:
                self._port.wait(min(left, IDLE_S))

    def _send(self, samples: list[TrackerSample]) -> None:
        packets = self._device.measure(samples)
        if self.stalled:
            return
        patient_until = time.perf_counter() + (_PATIENCE_S if self._pace is None else _REAL_TIME_PATIENCE_S)
        for packet in packets:
            with self._lock:
                self.bytes_sent += self._put(packet, max(0.0, patient_until - time.perf_counter()))
        self.samples_sent += len(packets) and len(samples)
