"""Four devices of different makes, axes, clocks and places at once, recorded and put together into one person."""

from contextlib import ExitStack

import numpy as np
import pytest

from devices.registry import make_device
from devices.room import RoomTransform
from devices.sample import ROLES
from devices.simulators.pty_simulator import simulate_device
from devices.simulators.source import Faults, SimulatedMotion
from replay_logs.frames import load_frames
from replay_logs.golden_takes import walking_on_the_spot
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice, read_take

SECONDS = 3.0
WORN = {
    "generic": ("root", "head"),
    "fastrak": ("left_wrist",),
    "liberty": ("right_wrist", "left_ankle"),
    "viper": ("right_ankle",),
}
PLACES = {
    "generic": RoomTransform(),
    "fastrak": RoomTransform.turned(40, (0.3, 0.8, 0.5)),
    "liberty": RoomTransform.turned(-100, (-0.5, 0.6, 0.4)),
    "viper": RoomTransform.turned(180, (0.2, 0.5, -0.7)),
}


def as_seen_from(place: RoomTransform, motion: SimulatedMotion) -> SimulatedMotion:
    """The motion in the axes of a device that stands there."""
    return SimulatedMotion((motion.positions - np.array(place.translation)) @ place.matrix, motion.fps)


def test_four_devices_make_one_person(tmp_path):
    path = tmp_path / "four.mcap"
    whole = walking_on_the_spot(ROLES, SECONDS)
    with ExitStack() as stack, TakeRecorder(path) as recorder:
        devices, simulators = [], []
        for i, (name, roles) in enumerate(WORN.items()):
            columns = [ROLES.index(role) for role in roles]
            motion = as_seen_from(PLACES[name], SimulatedMotion(whole.positions[:, columns], whole.fps))
            faults = Faults(clock_drift=1e-4 * i)
            simulator = stack.enter_context(simulate_device(motion, name, roles=roles, faults=faults))
            device = make_device(name, simulator.path)
            device.open()
            stack.callback(device.close)
            assignment = {str(n): role for n, role in enumerate(roles, 1)}
            recorder.add_device(RecordedDevice(name, name, device.protocol.options(), assignment, PLACES[name]))
            devices.append(device)
            simulators.append(simulator)
        sent_before = [simulator.bytes_sent for simulator in simulators]
        seen = dict.fromkeys(WORN, 0)
        finished, silent = False, False
        while not (finished and silent):
            # Asked before the reading, so that a device that has finished has nothing more to say after a silent round.
            finished = all(simulator.finished.is_set() for simulator in simulators)
            silent = True
            for device in devices:
                reading = device.read(0.001)
                recorder.write(device.name, reading)
                seen[device.name] += len(reading.samples)
                silent &= not reading.chunks
    take = read_take(path)
    assert [device.name for device in take.devices] == list(WORN)
    # All that was sent since the last device was opened is in the take, and is read as it was live; what a busy
    # machine makes a device drop is never sent.
    for device, simulator, before in zip(take.devices, simulators, sent_before, strict=True):
        assert sum(len(chunk.data) for chunk in take.chunks[device.name]) >= simulator.bytes_sent - before > 0
        assert sum(1 for _ in take.samples(device)) == seen[device.name] > 0
    frames = load_frames(path, 60)
    times = [reading.host_time_ns for reading in take.readings()]
    assert len(frames) == pytest.approx((times[-1] - times[0]) * 60e-9, abs=2)
    settled = np.array([frame.positions for frame in frames])[30:-10]
    # Each device began its motion at a moment of its own, so each role is compared with the path, not with a time.
    for role in range(len(ROLES)):
        track = settled[:, role][np.isfinite(settled[:, role, 0])]
        assert len(track)
        distance = np.linalg.norm(track[:, None] - whole.positions[None, :, role], axis=2).min(1)
        assert distance.max() < 0.02, ROLES[role]
