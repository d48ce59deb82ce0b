"""What a long session adds up to: memory, and bytes that are never lost on the way to a take."""

import tracemalloc

import pytest

from devices.assembler import FrameAssembler
from devices.intake import DeviceIntake
from devices.protocols import make_protocol, protocols
from devices.sample import ROLES
from devices.simulators.source import Faults, measurements
from tests.devices.motions import waving


def run(seconds: float, feeds: int) -> int:
    """Bytes in use after a stream through parser, intake and frames; the stream is that of `seconds`, over and over."""
    source = make_protocol("generic-binary")
    simulated = source.simulator(ROLES)
    told = list(measurements(waving(6, seconds), 60.0, Faults(noise_m=0.002, dropout=0.1)))
    packets = [b"x\0" * (i % 5 == 0) + b"".join(simulated.measure(samples)) for i, (_, samples) in enumerate(told)]
    reader = make_protocol("generic-binary")
    intake = DeviceIntake({str(i): role for i, role in enumerate(ROLES, 1)})
    assembler = FrameAssembler(60.0)
    tracemalloc.start()
    now_ns = 0
    for _ in range(feeds):
        for packet in packets:
            now_ns += 16_666_667
            assembler.push(intake.readings(reader.feed(packet, now_ns)))
            assembler.frames(now_ns)
    used, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return used


def test_memory_stays_flat():
    early, late = run(1.0, 10), run(1.0, 40)
    assert late < early + 20_000


@pytest.mark.nightly
def test_memory_stays_flat_over_a_simulated_day():
    assert run(60.0, 24 * 60) < run(60.0, 5) + 20_000


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
