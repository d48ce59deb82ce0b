"""A simulated device on a real pseudo-terminal, byte for byte as the real one on its cable."""

import random
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from devices.protocols import make_protocol
from devices.protocols.protocol import SimulatedDevice
from devices.sample import TrackerSample
from devices.simulators.paced_simulator import IDLE_S, PacedSimulator
from devices.simulators.pty_port import PtyPort
from devices.simulators.source import Faults, SimulatedMotion, measurements

_GARBAGE_BYTES = 40


class PtySimulator(PacedSimulator):
    """Plays a simulated device on a pseudo-terminal, see `PacedSimulator`.

    garbage: share of packets with random bytes before them. link: a fixed name for the port.
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
        self._garbage, self._random = garbage, random.Random(seed)
        self._pty = PtyPort(link)
        super().__init__(device, source, self._pty, pace=pace)

    def _converse(self) -> bool:
        heard = self._pty.read()
        if heard and not self.stalled:
            self._pty.write(self._device.answer(heard), IDLE_S)
        return bool(heard)

    def _put(self, packet: bytes, patience_s: float) -> int:
        if self._garbage and self._random.random() < self._garbage:
            packet = self._random.randbytes(self._random.randint(1, _GARBAGE_BYTES)) + packet
        return self._pty.write(packet, patience_s)


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
