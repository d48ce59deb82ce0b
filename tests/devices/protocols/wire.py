"""An imaginary line between a protocol's scripts and its simulator: no ports, no time."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from devices.protocols.protocol import (
    DeviceProtocol,
    Drain,
    GetFeature,
    Receive,
    Script,
    SendFeature,
    SetBaud,
    SetRts,
    SimulatedDevice,
    Write,
)
from devices.sample import TrackerSample

_VECTOR_FILE = Path(__file__).with_name("vectors.json")
VECTORS = {name: bytes.fromhex(text) for name, text in json.loads(_VECTOR_FILE.read_text()).items()}
"""The worked byte vectors of the protocol notes, by name."""

OPENED_AT = 115200
"""The speed a port is opened with."""

_W, _X, _Y, _Z = 0.943714364147489, 0.12767944069578063, -0.14487812541736916, 0.2685358227515692
"""Azimuth 30, elevation -20, roll 10 degrees, from the cosines and sines of 15, -10, 5 degrees."""

POSE_A_FRD = TrackerSample("1", 0, (-0.15, -0.45, -0.3), (_Y, -_Z, -_X, _W))
"""The notes' reference pose, (0.3, -0.15, 0.45) m in forward, right, down axes, as `RUB` has it."""


class Wire:
    """Carries out a script's steps against a simulator.

    bauds: the speeds at which the two understand each other. samples: what the device measures while it is listened to.
    """

    def __init__(
        self, device: SimulatedDevice, bauds: tuple[int, ...] | None = None, samples: Sequence[TrackerSample] = ()
    ) -> None:
        self.device = device
        self.samples = samples
        self.inbox = b""
        self.written = b""
        self.resets = 0
        self._bauds = bauds
        self._heard = bauds is None or OPENED_AT in bauds

    def run(self, script: Script) -> None:
        try:
            step = next(script)
            while True:
                step = script.send(self._carry_out(step))
        except StopIteration:
            return

    def _carry_out(self, step) -> bytes:
        match step:
            case Write(data):
                self.written += data
                if self._heard:
                    self.inbox += self.device.answer(data)
            case SetBaud(baud):
                self._heard = self._bauds is None or baud in self._bauds
            case SetRts(on):
                self.resets += on
            case Drain():
                self.inbox = b""
            case Receive(_, until, size):
                if self._heard and not (until in self.inbox if until else 0 < size <= len(self.inbox)):
                    self.inbox += b"".join(self.device.measure(self.samples))
                return self._take(until, size)
            case SendFeature(report):
                self.device.set_feature(report)
            case GetFeature(report_id, size):
                return self.device.get_feature(report_id, size)
        return b""

    def _take(self, until: bytes, size: int) -> bytes:
        end = len(self.inbox)
        if until and until in self.inbox:
            end = self.inbox.index(until) + len(until)
        elif size:
            end = min(size, end)
        taken, self.inbox = self.inbox[:end], self.inbox[end:]
        return taken


def decode(protocol: DeviceProtocol, chunks: Iterable[bytes]) -> list[TrackerSample]:
    """The samples of chunks fed one after the other at time 0."""
    return [sample for chunk in chunks for sample in protocol.feed(chunk, 0)]


def poll(protocol: DeviceProtocol, device: SimulatedDevice, host_time_ns: int) -> bytes:
    """What a polled device answers to what the protocol wants to send now."""
    return device.answer(protocol.to_send(host_time_ns))


def started(protocol: DeviceProtocol, trackers: int) -> SimulatedDevice:
    """A simulator that the protocol's own start-up script has brought to streaming."""
    device = protocol.simulator([f"tracker {n}" for n in range(trackers)])
    Wire(device, samples=[replace(POSE_A_FRD, tracker=str(n + 1)) for n in range(trackers)]).run(protocol.start())
    protocol.reset()
    return device
