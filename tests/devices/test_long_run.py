"""What a long session adds up to: memory, and bytes that are never lost on the way to a take."""

import tracemalloc
from pathlib import Path

import pytest

from devices.assembler import FrameAssembler
from devices.filters import OneEuroSettings
from devices.intake import DeviceIntake
from devices.protocols import make_protocol, protocols
from devices.sample import ROLES
from devices.simulators.source import Faults, measurements
from tests.devices.motions import waving


class Stream:
    """A device's stream through parser, intake and frames; that of `seconds`, over and over."""

    def __init__(self, seconds: float) -> None:
        source = make_protocol("generic-binary")
        simulated = source.simulator(ROLES)
        told = measurements(waving(6, seconds), 60.0, Faults(noise_m=0.002, dropout=0.1))
        self._packets = [
            b"x\0" * (i % 5 == 0) + b"".join(simulated.measure(samples)) for i, (_, samples) in enumerate(told)
        ]
        self._reader, self._assembler = make_protocol("generic-binary"), FrameAssembler(60.0)
        roles = {str(i): role for i, role in enumerate(ROLES, 1)}
        self._intake = DeviceIntake(roles, smoothing=OneEuroSettings(noise_above_mm=1.0))
        self._now_ns = self.frames = 0

    def run(self, times: int) -> None:
        for _ in range(times):
            for packet in self._packets:
                self._now_ns += 16_666_667
                self._assembler.push(self._intake.readings(self._reader.feed(packet, self._now_ns)))
                self.frames += len(self._assembler.complete()) + len(self._assembler.frames(self._now_ns))


def test_memory_stays_flat():
    stream = Stream(1.0)
    tracemalloc.start()
    stream.run(60)
    early, _ = tracemalloc.get_traced_memory()
    stream.run(60)
    late, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert late < early + 20_000


@pytest.mark.nightly
def test_memory_stays_flat_over_a_simulated_day():
    """A day at 60 Hz, 5.2 million frames of six trackers: about ten minutes on one core."""
    stream = Stream(60.0)
    stream.run(10)
    early = memory_mb()
    stream.run(24 * 60 - 10)
    assert stream.frames > 0.98 * 24 * 3600 * 60
    assert memory_mb() < early + 2.0


def memory_mb() -> float:
    """What this process has in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


@pytest.mark.parametrize("name", protocols())
def test_noise_without_end_is_not_hoarded(name):
    protocol = make_protocol(name)
    protocol.feed(b"\x55" * 1000, 0)
    tracemalloc.start()
    for _ in range(300):
        protocol.feed(b"\x55" * 1000, 0)
    used, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert used < 50_000
