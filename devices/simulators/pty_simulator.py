"""A simulated device on a real pseudo-terminal, byte for byte as the real one on its cable."""

import random
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from devices.protocols import make_protocol
from devices.protocols.protocol import SimulatedDevice
from devices.sample import TrackerSample
from devices.simulators.pty_port import PtyPort
from devices.simulators.source import Faults, SimulatedMotion, measurements

_IDLE_S = 0.02
"""How often a host that is not there is looked for."""
_PATIENCE_S = 5.0
"""How long a device that sends as fast as it can waits for the host to read."""
_REAL_TIME_PATIENCE_S = 0.25
"""How long one in real time does: a host on a busy machine reads late. Then bytes are lost, as on a cable."""
_GARBAGE_BYTES = 40


class PtySimulator:
    """Runs a simulated device on a pseudo-terminal, in a thread of its own, until its source ends or `close`.

    source: (seconds since start, samples of all trackers), as `measurements` gives them. The motion begins when a host
    has opened the port, and has started the device where it begins quiet. pace: 1 is real time, None as fast as the
    host reads. garbage: share of packets with random bytes before them. link: a fixed name for the port. Use as a
    context manager.
    """

    def __init__(
        self,
        device: SimulatedDevice,
        source: Iterable[tuple[float, list[TrackerSample]]],
        *,
        pace: float | None = 1.0,
        garbage: float = 0.0,
        link: Path | None = None,
        seed: int = 0,
    ) -> None:
        self._device, self._source, self._pace, self._garbage = device, source, pace, garbage
        self._random = random.Random(seed)
        self._lock = threading.Lock()
        self._port = PtyPort(link)
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

    @property
    def path(self) -> str:
        """The port for the host to open; another one after `replug`."""
        return self._port.path

    def unplug(self) -> None:
        """Pulls the cable out."""
        with self._lock:
            self._port.unplug()

    def replug(self) -> str:
        """Puts the cable back; the port may have another name, which is returned."""
        with self._lock:
            return self._port.plug()

    def stall(self, stalled: bool = True) -> None:
        """The device hangs: the port is there and nothing comes; False wakes it."""
        (self._stalled.set if stalled else self._stalled.clear)()

    def close(self) -> None:
        """Stops the device and removes the port."""
        self._closing.set()
        self._thread.join()
        self._port.unplug()

    def __enter__(self) -> "PtySimulator":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _run(self) -> None:
        self._wait_for_host()
        self.started.set()
        start = time.perf_counter()
        for time_s, samples in self._source:
            self._listen_until(start + time_s / self._pace if self._pace else 0.0)
            if self._closing.is_set():
                return
            self._send(samples)
        self.finished.set()
        while not self._closing.is_set():
            self._listen(_IDLE_S)

    def _wait_for_host(self) -> None:
        while not self._closing.is_set() and not self._port.host_is_there:
            self._closing.wait(_IDLE_S)
        while not self._closing.is_set() and not self._device.streaming:
            self._listen(_IDLE_S)

    def _listen_until(self, moment: float) -> None:
        while True:
            left = moment - time.perf_counter()
            self._listen(min(max(left, 0.0), _IDLE_S))
            if left <= _IDLE_S or self._closing.is_set():
                return

    def _listen(self, timeout_s: float) -> None:
        """Answers the host for as long as that, not much longer."""
        end = time.perf_counter() + timeout_s
        while True:
            with self._lock:
                heard = self._port.read()
                if heard and not self._stalled.is_set():
                    self._port.write(self._device.answer(heard), _IDLE_S)
            left = end - time.perf_counter()
            if left <= 0 or self._closing.is_set():
                return
            if not heard:
                self._port.wait(min(left, _IDLE_S))

    def _send(self, samples: list[TrackerSample]) -> None:
        packets = self._device.measure(samples)
        if self._stalled.is_set():
            return
        patient_until = time.perf_counter() + (_PATIENCE_S if self._pace is None else _REAL_TIME_PATIENCE_S)
        for packet in packets:
            if self._garbage and self._random.random() < self._garbage:
                packet = self._random.randbytes(self._random.randint(1, _GARBAGE_BYTES)) + packet
            with self._lock:
                self.bytes_sent += self._port.write(packet, max(0.0, patient_until - time.perf_counter()))
        self.samples_sent += len(packets) and len(samples)


@contextmanager
def simulate_device(
    motion: SimulatedMotion,
    device: str = "generic",
    *,
    roles: Sequence[str],
    rate_hz: float | None = None,
    faults: Faults | None = None,
    loop: bool = False,
    pace: float | None = 1.0,
    garbage: float = 0.0,
    link: Path | None = None,
    quiet: bool = False,
    **options: object,
) -> Iterator[PtySimulator]:
    """A device of that name on a pseudo-terminal, its trackers 1, 2, ... sitting where `roles` say.

    rate_hz: measurements a second, by default what the device usually makes. quiet: send nothing before the host says
    start, even where the device could. options: of the protocol. Raises SettingError for an unknown device or option.
    """
    protocol = make_protocol(device, **options)
    source = measurements(motion, rate_hz or protocol.rate_hz, faults, loop)
    seed = faults.seed if faults else 0
    simulated = protocol.simulator(roles)
    simulated.streaming &= not quiet
    with PtySimulator(simulated, source, pace=pace, garbage=garbage, link=link, seed=seed) as simulator:
        yield simulator
