"""The demo's take: our own show as six trackers saw it, over the generic binary protocol, with a millimetre of noise.

`python -m capture.demo_take` makes it anew; the same code gives the same bytes but for the time stamp.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from devices.driver import RawChunk, Reading
from devices.protocols import make_protocol
from devices.sample import ROLES
from devices.simulators.source import Faults, SimulatedMotion, measurements
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_library import demo_motion
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice

TAKE = Path(__file__).parents[1] / "replay_logs" / "takes" / "demo.mcap"
_PROTOCOL = "generic-binary"
_FAULTS = Faults(noise_m=0.001, seed=1)
_START_NS = 1_000_000_000


def trackers_on(motion: Motion) -> SimulatedMotion:
    """Ideal trackers at the joints of the six roles, with their orientations."""
    positions, rotations = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    joints = [motion.skeleton.role_joint(role) for role in ROLES]
    quaternions = Rotation.from_matrix(rotations[:, joints].reshape(-1, 3, 3)).as_quat()
    return SimulatedMotion(positions[:, joints], motion.fps, quaternions.reshape(len(motion), len(ROLES), 4))


def make_demo_take(path: Path) -> None:
    """Records the demo's take. Raises FileError where the file exists."""
    protocol = make_protocol(_PROTOCOL)
    simulated = protocol.simulator(ROLES)
    assignment = {str(number): role for number, role in enumerate(ROLES, 1)}
    with TakeRecorder(path) as recorder:
        recorder.add_device(RecordedDevice("trackers", _PROTOCOL, protocol.options(), assignment))
        recorder.write("trackers", Reading((RawChunk(_START_NS, b""),)))
        for time_s, told in measurements(trackers_on(demo_motion()), 60.0, _FAULTS):
            now_ns = _START_NS + round(time_s * 1e9)
            packets = simulated.measure(told)
            samples = tuple(sample for packet in packets for sample in protocol.feed(packet, now_ns))
            recorder.write("trackers", Reading(tuple(RawChunk(now_ns, packet) for packet in packets), samples))


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TAKE
    target.unlink(missing_ok=True)
    make_demo_take(target)
    print(f"wrote {target}: {np.round(target.stat().st_size / 1024)} KiB")
