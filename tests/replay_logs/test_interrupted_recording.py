"""A cable pulled out in the middle of a recording: what was read is in the take, and reads back as it was."""

import time

from devices.reconnecting import ReconnectingDevice
from devices.registry import make_device
from devices.simulators.pty_simulator import simulate_device
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice, read_take
from tests.devices.motions import waving


def test_a_recording_goes_on_after_the_cable_is_back_and_decodes_to_what_was_seen(tmp_path):
    path, samples, told = tmp_path / "a.mcap", [], []
    with simulate_device(waving(2, 60.0), "fastrak", roles=("root", "head"), link=tmp_path / "port") as simulator:
        device = ReconnectingDevice(make_device("fastrak", str(tmp_path / "port")), told.append)
        device.open()
        with TakeRecorder(path) as recorder:
            options = device.driver.protocol.options()
            recorder.add_device(RecordedDevice("fastrak", "fastrak", options, {"1": "root", "2": "head"}))

            def record(seconds: float) -> int:
                end, before = time.perf_counter() + seconds, len(samples)
                while time.perf_counter() < end:
                    reading = device.read(0.02)
                    recorder.write("fastrak", reading)
                    samples.extend(reading.samples)
                return len(samples) - before

            assert record(0.4) > 0
            simulator.unplug()
            record(0.3)
            simulator.replug()
            # FASTRAK's start-up drains and asks before it streams.
            assert record(2.0) > 0
        device.close()
    take = read_take(path)
    assert list(take.samples(take.devices[0])) == samples
    assert sum(not chunk.data for chunk in take.chunks["fastrak"]) == 2
    assert len(told) == 2
