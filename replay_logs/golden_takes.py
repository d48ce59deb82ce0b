"""The golden takes in `takes/`: a short take of raw bytes for every protocol, of our own motion and simulators.

`python -m replay_logs.golden_takes` makes them anew; the same code gives the same bytes but for their time stamp.
"""

import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from devices.driver import RawChunk, Reading
from devices.link import run_script
from devices.protocols import make_protocol, protocols
from devices.protocols.protocol import DeviceProtocol
from devices.room import RoomTransform
from devices.sample import ROLES, TrackerSample
from devices.simulators.loopback import LoopbackLink
from devices.simulators.source import SimulatedMotion, measurements
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice

FOLDER = Path(__file__).with_name("takes")
SECONDS = 3.0
HIDDEN_S = (1.5, 1.8)
"""When the second tracker is not seen."""
GARBAGE = 0.05
"""Share of serial packets with random bytes before them."""
PLACE = RoomTransform((0.0, 0.0, 0.0, 1.0), (0.0, 0.85, 0.6))
"""The device stands in front of the performer at waist height: within reach of the shortest-ranged one."""
_START_NS = 1_000_000_000
_LARGEST_RATE_HZ = 60.0
_WORN = {2: ROLES[2:4], 4: ROLES[2:6], 6: ROLES}
"""Who wears what, by how many trackers there are."""


def walking_on_the_spot(roles: tuple[str, ...], seconds: float, fps: float = 120.0) -> SimulatedMotion:
    """Trackers of a person of 1.75 m who marches on the spot, one step each half second, in the world."""
    t = np.arange(round(seconds * fps) + 1) / fps
    step = np.pi * t / 0.5
    lift = {"left": np.clip(np.sin(step), 0, None), "right": np.clip(-np.sin(step), 0, None)}
    places = {
        "root": (0.02 * np.sin(step), 0.94 + 0.02 * np.cos(2 * step), 0 * t),
        "head": (0.01 * np.sin(step), 1.58 + 0.02 * np.cos(2 * step), 0.03 + 0 * t),
    }
    for side, sign in (("left", 1), ("right", -1)):
        other = np.sin(step) * -sign
        places[f"{side}_wrist"] = (sign * 0.28 + 0 * t, 0.86 + 0.05 * np.abs(other), 0.06 + 0.16 * other)
        places[f"{side}_ankle"] = (sign * 0.1 + 0 * t, 0.08 + 0.2 * lift[side], -0.08 * lift[side])
    return SimulatedMotion(np.stack([np.stack(places[role], -1) for role in roles], 1), fps)


@dataclass(frozen=True, slots=True)
class GoldenSource:
    """What one protocol's golden take is made of."""

    protocol: DeviceProtocol
    roles: tuple[str, ...]
    rate_hz: float

    @classmethod
    def of(cls, name: str) -> "GoldenSource":
        """As many trackers as the device has, up to six, at its own rate up to 60 Hz."""
        protocol = make_protocol(name)
        count = max(n for n in _WORN if n <= max(2, protocol.max_trackers))
        return cls(protocol, _WORN[count], min(protocol.rate_hz, _LARGEST_RATE_HZ))

    def told(self) -> Iterator[tuple[float, list[TrackerSample]]]:
        """What the simulated device measures, in its own place, with one tracker hidden for a while."""
        motion = walking_on_the_spot(self.roles, SECONDS)
        positions = motion.positions - np.array(PLACE.translation)
        times = np.arange(len(positions)) / motion.fps
        positions[(times >= HIDDEN_S[0]) & (times < HIDDEN_S[1]), 1] = np.nan
        return measurements(SimulatedMotion(positions, motion.fps), self.rate_hz)


def make_golden_take(name: str, path: Path) -> None:
    """Records a protocol's golden take."""
    source = GoldenSource.of(name)
    protocol, simulated = source.protocol, source.protocol.simulator(source.roles)
    _, first = next(source.told())
    link = LoopbackLink(simulated, streamed=lambda: simulated.measure(first))
    run_script(link, protocol.start())
    link.streamed = list
    protocol.reset()
    link.read(0.0)
    rng = random.Random(name)
    device = None
    with TakeRecorder(path) as recorder:
        for time_s, told in source.told():
            now_ns = _START_NS + round(time_s * 1e9)
            link.deliver([_littered(packet, protocol, rng) for packet in simulated.measure(told)])
            request = protocol.to_send(now_ns)
            if request:
                link.write(request)
            packets = link.read(0.0)
            samples = [sample for packet in packets for sample in protocol.feed(packet, now_ns)]
            if device is None:
                assignment = _assignment(samples, source.roles)
                if len(assignment) < len(source.roles):
                    raise AssertionError(f"{name}: the first measurement must name every tracker: {assignment}")
                device = RecordedDevice(name, name, protocol.options(), assignment, PLACE)
                recorder.add_device(device)
                recorder.write(name, Reading((RawChunk(now_ns, b""),)))
            chunks = tuple(RawChunk(now_ns, packet) for packet in packets)
            recorder.write(name, Reading(chunks, tuple(samples)))


def _littered(packet: bytes, protocol: DeviceProtocol, rng: random.Random) -> bytes:
    if protocol.link == "hid" or rng.random() >= GARBAGE:
        return packet
    return rng.randbytes(rng.randint(1, 30)) + packet


def _assignment(samples: list[TrackerSample], roles: tuple[str, ...]) -> dict[str, str]:
    trackers = list(dict.fromkeys(sample.tracker for sample in samples))
    return dict(zip(trackers, roles, strict=False))


def main() -> None:
    """Makes all of them anew."""
    FOLDER.mkdir(exist_ok=True)
    for name in protocols():
        path = FOLDER / f"{name}.mcap"
        path.unlink(missing_ok=True)
        make_golden_take(name, path)
        print(f"{path.name}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
