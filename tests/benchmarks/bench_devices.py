"""How fast bytes become samples: `python -m tests.benchmarks.bench_devices [--json]`.

For every protocol the time to parse one sample, in chunks of one measurement as they come off a line, and the share of
a core that six trackers at 960 Hz would take; and for those that stream over a serial port, the time from writing a
packet into a pseudo-terminal to having its sample in hand, through pyserial and the driver.
"""

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from devices.link import run_script
from devices.linked_device import LinkedDevice
from devices.protocols import make_protocol, protocols
from devices.protocols.protocol import DeviceProtocol
from devices.sample import ROLES
from devices.serial_link import SerialLink
from devices.simulators.loopback import LoopbackLink
from devices.simulators.pty_port import PtyPort
from devices.simulators.source import measurements
from tests.devices.motions import waving

CYCLES = 400
ROUNDS = 5
FULL_LOAD_HZ = 6 * 960


@dataclass(frozen=True, slots=True)
class DeviceFigures:
    """One protocol's figures. latency_us: median and 99th percentile, None for HID and polled devices."""

    name: str
    parse_us: float
    core_share: float
    latency_us: tuple[float, float] | None


def packets_of(protocol: DeviceProtocol, cycles: int = CYCLES) -> list[list[bytes]]:
    """What the simulated device sends, cycle by cycle, after the protocol's own start-up."""
    roles = ROLES[: min(6, protocol.max_trackers)]
    device = protocol.simulator(roles)
    told = [samples for _, samples in measurements(waving(len(roles), cycles / 60), 60)][:cycles]
    run_script(LoopbackLink(device, streamed=lambda: device.measure(told[0])), protocol.start())
    protocol.reset()
    sent = []
    for cycle, samples in enumerate(told):
        packets = device.measure(samples)
        request = protocol.to_send(cycle * 1_000_000_000)
        sent.append([*packets, device.answer(request)] if request else packets)
    return sent


def parse_us(name: str, cycles: Sequence[list[bytes]]) -> float:
    """Microseconds a sample: the best of some rounds."""
    joined = protocols()[name].link == "serial"
    chunks = [b"".join(packets) for packets in cycles] if joined else [p for packets in cycles for p in packets]
    best = float("inf")
    for _ in range(ROUNDS):
        protocol = make_protocol(name)
        begun = time.perf_counter()
        samples = sum(len(protocol.feed(chunk, 0)) for chunk in chunks)
        best = min(best, (time.perf_counter() - begun) / max(samples, 1))
    return best * 1e6


def latency_us(name: str, cycles: Sequence[list[bytes]]) -> tuple[float, float]:
    """Median and 99th percentile of the microseconds from a packet's last byte written to its sample read."""
    port, protocol = PtyPort(), make_protocol(name)
    device = LinkedDevice(name, SerialLink(port.path, protocol.serial), protocol)
    device.link.open()
    took = []
    for packet in (packets[0] for packets in cycles):
        port.write(packet)
        written = time.perf_counter()
        while not device.read(0.1).samples:
            if time.perf_counter() - written > 1.0:
                raise RuntimeError(f"{name}: a packet gave no sample")
        took.append(time.perf_counter() - written)
    device.link.close()
    port.unplug()
    median, late = np.percentile(took, [50, 99]) * 1e6
    return float(median), float(late)


def measure(name: str) -> DeviceFigures:
    """All figures of one protocol with its default options."""
    protocol = make_protocol(name)
    cycles = packets_of(protocol)
    parse = parse_us(name, cycles)
    polled = bool(make_protocol(name).to_send(0))
    streams = protocol.link == "serial" and not polled
    return DeviceFigures(name, parse, parse * 1e-6 * FULL_LOAD_HZ, latency_us(name, cycles) if streams else None)


def main() -> None:
    """Measures every protocol and prints a table, or JSON."""
    figures = [measure(name) for name in protocols()]
    if "--json" in sys.argv:
        print(json.dumps([asdict(f) for f in figures], indent=1))
        return
    print(f"{'device':16} {'us/sample':>10} {'6 x 960 Hz':>11} {'byte to sample p50':>19} {'p99 us':>8}")
    for f in figures:
        late = f"{f.latency_us[0]:19.0f} {f.latency_us[1]:8.0f}" if f.latency_us else f"{'-':>19} {'-':>8}"
        print(f"{f.name:16} {f.parse_us:10.1f} {100 * f.core_share:10.1f}% {late}")


if __name__ == "__main__":
    main()
