"""Takes made without ports: a simulated device's packets written as if they had come over a line."""

from dataclasses import dataclass, field
from pathlib import Path

from devices.driver import RawChunk, Reading
from devices.protocols import make_protocol
from devices.sample import TrackerSample
from devices.simulators.source import Faults, SimulatedMotion, measurements
from replay_logs.player import TakePlayer
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice

START_NS = 5_000_000_000


@dataclass
class Recorded:
    """What went through a device."""

    chunks: list[RawChunk] = field(default_factory=list)
    samples: list[TrackerSample] = field(default_factory=list)

    def add(self, reading: Reading) -> None:
        self.chunks += reading.chunks
        self.samples += reading.samples


def record_simulated(
    path: Path,
    motion: SimulatedMotion,
    assignment: dict[str, str],
    *,
    faults: Faults | None = None,
    metadata: dict[str, str] | None = None,
) -> Recorded:
    """Records a generic device called `suit`, one chunk a measurement, 60 a second."""
    protocol, recorded = make_protocol("generic"), Recorded()
    simulated = protocol.simulator(list(assignment.values()))
    with TakeRecorder(path, metadata) as recorder:
        recorder.add_device(RecordedDevice("suit", "generic", {}, assignment))
        opened = Reading((RawChunk(START_NS, b""),))
        recorder.write("suit", opened)
        recorded.add(opened)
        for time_s, told in measurements(motion, 60, faults):
            now_ns = START_NS + round(time_s * 1e9)
            data = b"".join(simulated.measure(told))
            reading = Reading((RawChunk(now_ns, data),), tuple(protocol.feed(data, now_ns)))
            recorder.write("suit", reading)
            recorded.add(reading)
    return recorded


def read_out(player: TakePlayer) -> Recorded:
    """All that a player has to give."""
    played = Recorded()
    while not player.finished:
        played.add(player.read(0.1))
    return played
