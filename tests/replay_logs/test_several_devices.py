"""Four devices of different makes, axes, clocks and places at once, recorded and put together into one person."""

import time
from contextlib import ExitStack

import numpy as np

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
            simulator = stack.enter_context(simulate_device(motion, name, roles=roles, faults=faults, loop=True))
            device = make_device(name, simulator.path)
            device.open()
            stack.callback(device.close)
            assignment = {str(n): role for n, role in enumerate(roles, 1)}
            recorder.add_device(RecordedDevice(name, name, device.protocol.options(), assignment, PLACES[name]))
            devices.append(device)
            simulators.append(simulator)
        begin = time.perf_counter()
        while time.perf_counter() - begin < SECONDS:
            for device in devices:
                recorder.write(device.name, device.read(0.001))
    take = read_take(path)
    assert [device.name for device in take.devices] == list(WORN)
    frames = load_frames(path, 60)
    assert len(frames) > 0.9 * 60 * SECONDS
    positions = np.array([frame.positions for frame in frames])
    settled = positions[30:-10]
    assert np.isfinite(settled).mean() > 0.95
    # Each device began its motion at a moment of its own, so each role is compared with the path, not with a time.
    for role in range(len(ROLES)):
        track = settled[:, role][np.isfinite(settled[:, role, 0])]
        distance = np.linalg.norm(track[:, None] - whole.positions[None, :, role], axis=2).min(1)
        assert distance.max() < 0.02, ROLES[role]
