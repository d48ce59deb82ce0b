"""Serial devices on real pseudo-terminals with real pyserial, when things go wrong: ours crashes, cables, garbage."""

import time

import pytest

from devices.errors import DeviceError
from devices.linked_device import LinkedDevice
from devices.protocols import make_protocol
from devices.reconnecting import DeviceState, ReconnectingDevice
from devices.registry import make_device
from devices.sample import ROLES, TrackerSample
from devices.simulators.pty_port import PtyPort
from devices.simulators.pty_simulator import PtySimulator, simulate_device
from tests.devices.motions import waving

SECONDS = 1.0
DEVICES = [
    ("fastrak", {"binary": False, "items": (2, 4, 1)}, 2, 2e-4),
    ("isotrak2", {}, 2, 2e-4),
    ("liberty", {}, 6, 1e-5),
    ("viper", {}, 6, 1e-5),
    ("flock_of_birds", {"full_scale_in": 72}, 4, 3e-4),
    ("ndi", {}, 4, 1e-5),
    ("ndi", {"binary": False}, 2, 2e-5),
    ("dwm1001", {}, 4, 6e-3),
    ("dwm1001", {"binary": True}, 1, 1e-3),
    ("marvelmind", {}, 6, 1e-3),
]
every_device = pytest.mark.parametrize(
    ("name", "options", "trackers", "tolerance_m"), DEVICES, ids=[f"{d[0]}-{i}" for i, d in enumerate(DEVICES)]
)


def read_until_quiet(device: LinkedDevice, simulator: PtySimulator) -> tuple[list[TrackerSample], list[bytes]]:
    """Samples and chunks to the end of the motion and a little longer."""
    samples, chunks = read_for(device, 0.0)
    while not simulator.finished.is_set():
        more_samples, more_chunks = read_for(device, 0.15)
        samples, chunks = samples + more_samples, chunks + more_chunks
    tail_samples, tail_chunks = read_for(device, 0.15)
    return samples + tail_samples, chunks + tail_chunks


def read_for(device: LinkedDevice, seconds: float) -> tuple[list[TrackerSample], list[bytes]]:
    samples, chunks = [], []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        reading = device.read(0.02)
        samples += reading.samples
        chunks += [chunk.data for chunk in reading.chunks]
    return samples, chunks


@every_device
def test_it_starts_survives_a_crash_of_ours_and_is_read_to_the_end(name, options, trackers, tolerance_m):
    motion = waving(trackers, SECONDS)
    with simulate_device(motion, name, roles=ROLES[:trackers], **options) as simulator:
        crashed = make_device(name, simulator.path, options=options)
        crashed.open()
        read_for(crashed, 0.1)
        crashed.link.close()
        device = make_device(name, simulator.path, options=options)
        device.open()
        device.protocol.counters.bad_frames = 0
        # A polled device goes on answering with its last measurement.
        samples, chunks = read_until_quiet(device, simulator)
        device.close()
    last = {int(sample.tracker): sample.position for sample in samples}
    assert sorted(last) == list(range(1, trackers + 1))
    slack_m = 0.05 if name in ("dwm1001", "marvelmind") else tolerance_m  # their last tick is before the last row
    for number, position in last.items():
        assert position == pytest.approx(motion.positions[-1, number - 1], abs=slack_m)
    assert device.protocol.counters.bad_frames <= 1
    again = make_protocol(name, **device.protocol.options())
    assert [(s.tracker, s.position) for chunk in chunks for s in again.feed(chunk, 0)] == [
        (s.tracker, s.position) for s in samples
    ]


@pytest.mark.parametrize("name", ["fastrak", "viper", "ndi"])
def test_a_replugged_and_a_restarted_device_are_taken_up_again(name, tmp_path):
    def read_until_samples(device: ReconnectingDevice) -> bool:
        end = time.perf_counter() + 10
        return any(device.read(0.05).samples for _ in iter(lambda: time.perf_counter() < end, False))

    with simulate_device(waving(2, 60.0), name, roles=ROLES[:2], link=tmp_path / "port") as simulator:
        device = ReconnectingDevice(make_device(name, str(tmp_path / "port")), silent_s=0.3)
        device.open()
        assert read_until_samples(device)
        simulator.unplug()
        while device.state is DeviceState.STREAMING:
            device.read(0.05)
        simulator.replug()
        assert read_until_samples(device)
        simulator._device = make_protocol(name).simulator(ROLES[:2])  # switched off and on: all settings forgotten
        while device.state is DeviceState.STREAMING:
            device.read(0.05)
        assert read_until_samples(device)
        device.close()


def test_a_port_with_nothing_behind_it_is_one_clear_line():
    port = PtyPort()
    try:
        with pytest.raises(DeviceError, match="no answer from Polhemus VIPER"):
            make_device("viper", port.path).open()
    finally:
        port.unplug()


def test_garbage_on_the_line_costs_little():
    with simulate_device(waving(4, 1.0), "fastrak", roles=ROLES[:4], garbage=0.3) as simulator:
        device = make_device("fastrak", simulator.path)
        device.open()
        samples, _ = read_until_quiet(device, simulator)
        device.close()
    assert len(samples) >= 0.9 * simulator.samples_sent
    assert device.protocol.counters.bytes_dropped > 0
