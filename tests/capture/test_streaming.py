"""The datagrams are read with python-osc, and VMC's bones are put together again in Unity's left-handed world."""

import importlib.util
import json
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pythonosc.osc_bundle import OscBundle
from scipy.spatial.transform import Rotation

from capture.streaming import JsonEncoder, VmcEncoder, VrchatEncoder, open_stream
from devices.errors import SettingError
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Motion
from reconstruction.motion_files import write_bvh
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

SKELETON = standard_skeleton(1.75)
T_POSE = np.tile([0.0, 0.0, 0.0, 1.0], (len(SKELETON), 1))
MIRROR = np.diag([-1.0, 1.0, 1.0])


def pose(seed: int | None) -> np.ndarray:
    rotations = T_POSE
    if seed is not None:
        random = np.random.default_rng(seed)
        rotations = Rotation.from_rotvec(random.normal(size=(len(SKELETON), 3)) * 0.7).as_quat()
    return world_transforms(SKELETON, np.array([0.3, 0.95, -1.2]), rotations)


def messages(datagrams: list[bytes]) -> dict[tuple, tuple]:
    """Arguments by address and, for bones, name."""
    found = {}
    for datagram in datagrams:
        assert len(datagram) <= 1400
        for message in OscBundle(datagram):
            key = (message.address, *[p for p in message.params if isinstance(p, str)])
            assert key not in found
            found[key] = tuple(p for p in message.params if not isinstance(p, str))
    return found


def unity_bones(found: dict[tuple, tuple]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {
        key[1]: (np.array(values[:3]), Rotation.from_quat(values[3:]).as_matrix())
        for key, values in found.items()
        if key[0] == "/VMC/Ext/Bone/Pos"
    }


UNITY_PARENTS = {
    "Spine": "Hips",
    "Chest": "Spine",
    "UpperChest": "Chest",
    "Neck": "UpperChest",
    "Head": "Neck",
} | {
    f"{side}{bone}": above if above in ("Hips", "UpperChest") else f"{side}{above}"
    for side in ("Left", "Right")
    for bone, above in (
        ("Shoulder", "UpperChest"),
        ("UpperArm", "Shoulder"),
        ("LowerArm", "UpperArm"),
        ("Hand", "LowerArm"),
        ("UpperLeg", "Hips"),
        ("LowerLeg", "UpperLeg"),
        ("Foot", "LowerLeg"),
        ("Toes", "Foot"),
    )
}


def test_in_the_t_pose_no_vmc_bone_is_turned():
    found = messages(VmcEncoder(SKELETON)(0.0, pose(None)))
    for name, (_, rotation) in unity_bones(found).items():
        assert np.abs(rotation - np.eye(3)).max() < 1e-5, name


@pytest.mark.parametrize("seed", range(5))
def test_vmc_bones_put_together_stand_where_the_joints_do(seed):
    joints = pose(seed)
    bones = unity_bones(messages(VmcEncoder(SKELETON)(1.5, joints)))
    assert set(bones) == {"Hips", *UNITY_PARENTS}

    def world(name: str) -> tuple[np.ndarray, np.ndarray]:
        position, rotation = bones[name]
        if name == "Hips":
            return position, rotation
        above, turned = world(UNITY_PARENTS[name])
        return above + turned @ position, turned @ rotation

    for bone, joint in SKELETON.humanoid.items():
        unity = "".join(part.capitalize() for part in bone.split("_"))
        position, rotation = world(unity)
        assert np.abs(position - MIRROR @ joints[joint, :3, 3]).max() < 1e-5
        assert np.abs(rotation - MIRROR @ joints[joint, :3, :3] @ MIRROR).max() < 1e-5


def test_vmc_tells_that_it_is_there_and_what_time_it_is():
    found = messages(VmcEncoder(SKELETON)(12.25, pose(1)))
    assert found["/VMC/Ext/OK",] == (1,)
    assert found["/VMC/Ext/T",] == (12.25,)
    assert found["/VMC/Ext/Root/Pos", "root"] == (0, 0, 0, 0, 0, 0, 1)


def test_a_skeleton_that_rests_with_hanging_arms_and_spread_legs_sends_the_same():
    """How a file's rest pose stands must not show in what is sent."""
    leaning = {"LeftArm": 40, "RightArm": -40, "LeftUpLeg": -20, "RightUpLeg": 20}
    turned = np.zeros(len(SKELETON))
    for joint, parent in enumerate(SKELETON.parents):
        turned[joint] = leaning.get(SKELETON.names[joint], turned[parent] if parent >= 0 else 0)
    rest = Rotation.from_rotvec(np.radians(turned)[:, None] * [0.0, 0.0, 1.0])
    above = rest[np.maximum(SKELETON.parents, 0)]
    other = Skeleton(SKELETON.names, SKELETON.parents, above.inv().apply(SKELETON.offsets))
    joints = pose(3)
    moved = joints.copy()
    moved[:, :3, :3] = joints[:, :3, :3] @ rest.as_matrix()
    plain = unity_bones(messages(VmcEncoder(SKELETON)(0.0, joints)))
    others = unity_bones(messages(VmcEncoder(other)(0.0, moved)))
    for name in plain.keys() - {"LeftFoot", "RightFoot", "LeftToes", "RightToes"}:
        assert np.abs(plain[name][1] - others[name][1]).max() < 1e-5, name
        assert np.abs(plain[name][0] - others[name][0]).max() < 1e-5, name


def test_vrchat_trackers_carry_unitys_positions_and_angles():
    joints = pose(7)
    found = messages(VrchatEncoder(SKELETON)(0.0, joints))
    assert len(found) == 18
    for name, bone in (("1", "hips"), ("3", "left_foot"), ("8", "right_lower_arm"), ("head", "head")):
        joint = SKELETON.humanoid[bone]
        position = found[f"/tracking/trackers/{name}/position",]
        assert np.allclose(position, MIRROR @ joints[joint, :3, 3], atol=1e-5)
        x, y, z = found[f"/tracking/trackers/{name}/rotation",]
        rotation = Rotation.from_euler("YXZ", [y, x, z], degrees=True).as_matrix()
        assert np.abs(rotation - MIRROR @ joints[joint, :3, :3] @ MIRROR).max() < 1e-5


def test_vrchat_angles_are_zero_in_the_t_pose_and_right_at_the_pole():
    found = messages(VrchatEncoder(SKELETON)(0.0, pose(None)))
    assert np.abs([v for key, v in found.items() if key[0].endswith("rotation")]).max() < 1e-3
    joints = pose(None).copy()
    pole = Rotation.from_euler("YXZ", [30, 90, 0], degrees=True).as_matrix()
    joints[:, :3, :3] = MIRROR @ pole @ MIRROR
    x, y, z = messages(VrchatEncoder(SKELETON)(0.0, joints))["/tracking/trackers/1/rotation",]
    back = Rotation.from_euler("YXZ", [y, x, z], degrees=True).as_matrix()
    assert np.abs(back - pole).max() < 1e-4


def test_json_holds_every_joint_in_our_own_world():
    encode, joints = JsonEncoder(SKELETON), pose(2)
    first, second = (json.loads(encode(time_s, joints)[0]) for time_s in (0.5, 0.6))
    assert (first["version"], first["number"], second["number"]) == (1, 0, 1)
    assert first["time_s"] == 0.5
    for name, joint in joints_by_name(joints).items():
        values = first["joints"][name]
        assert np.allclose(values[:3], joint[:3, 3], atol=1e-5)
        assert np.allclose(Rotation.from_quat(values[3:]).as_matrix(), joint[:3, :3], atol=1e-4)


def joints_by_name(joints: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(SKELETON.names, joints, strict=True))


@pytest.mark.parametrize("scheme", ["vmc", "vrchat", "json"])
def test_a_stream_reaches_its_address(scheme):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5)
        stream = open_stream(f"{scheme}://127.0.0.1:{receiver.getsockname()[1]}", SKELETON)
        stream.send(0.0, pose(0))
        assert len(receiver.recv(65536)) > 200
        assert stream.sent >= 1
        stream.close()


def test_the_command_sends_every_pose_of_a_motion(tmp_path):
    import typer
    from typer.testing import CliRunner

    from capture.commands.stream import stream

    motion = Motion(SKELETON, np.tile([0.0, 0.95, 0.0], (6, 1)), np.tile(T_POSE, (6, 1, 1)), 120.0)
    write_bvh(motion, tmp_path / "still.bvh")
    app = typer.Typer()
    app.command()(stream)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5)
        address = f"json://127.0.0.1:{receiver.getsockname()[1]}"
        done = CliRunner().invoke(app, [str(tmp_path / "still.bvh"), "--to", address])
        assert done.exit_code == 0, done.output
        assert "6 datagrams sent, 0 not taken" in done.output
        poses = [json.loads(receiver.recv(65536)) for _ in range(6)]
    assert [p["number"] for p in poses] == list(range(6))
    assert poses[5]["time_s"] == pytest.approx(5 / 120, abs=1e-5)
    assert np.allclose(poses[0]["joints"]["Hips"][:3], [0, 0.95, 0])


def test_nobody_listening_harms_nobody():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    stream = open_stream(f"json://127.0.0.1:{port}", SKELETON)
    for number in range(20):
        stream.send(number / 60, pose(0))
    assert stream.sent + stream.dropped == 20
    stream.close()


def test_wrong_addresses_are_told():
    with pytest.raises(SettingError, match="use vmc, vrchat, json"):
        open_stream("osc://127.0.0.1:9000", SKELETON)
    with pytest.raises(SettingError, match="write it like"):
        open_stream("vmc://127.0.0.1:99999999", SKELETON)
    with pytest.raises(SettingError, match=r"no host 'nowhere\.invalid'"):
        open_stream("vmc://nowhere.invalid", SKELETON)


RECEIVER = """
import sys, time
sys.path.insert(0, {here!r})
from vmcp.osc import OSC
from vmcp.osc.backend.osc4py3 import as_comthreads as backend
from vmcp.events import BoneTransformEvent, RelativeTimeEvent, RootTransformEvent, StateEvent
from vmcp.facades import on_receive
from capture.streaming import open_stream
from tests.capture.test_streaming import SKELETON, pose

seen = {{}}
osc = OSC(backend)
with osc.open():
    receiver = osc.create_receiver("127.0.0.1", {port}, "receiver").open()
    for event in (BoneTransformEvent, RelativeTimeEvent, RootTransformEvent, StateEvent):
        on_receive(receiver, event, lambda e: seen.setdefault(type(e).__name__, []).append(e))
    stream = open_stream("vmc://127.0.0.1:{port}", SKELETON)
    deadline = time.monotonic() + 10
    while len(seen.get("BoneTransformEvent", [])) < 22 and time.monotonic() < deadline:
        stream.send(2.5, pose(6))
        for _ in range(10):
            osc.run()
            time.sleep(0.01)
for bone in seen["BoneTransformEvent"][:22]:
    p, q = bone.position, bone.rotation
    print("bone", bone.joint.value, p.x, p.y, p.z, q.x, q.y, q.z, q.w)
print("time", seen["RelativeTimeEvent"][0].delta)
print("state", seen["StateEvent"][0].model_state.value)
assert seen["RootTransformEvent"]
"""


def test_an_independent_vmc_receiver_understands_every_bone():
    for package in ("vmcp", "osc4py3"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"the VMC receiver library is not installed (pip install vmcp[osc4py3]: {package})")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    here = str(Path(__file__).parents[2])
    script = RECEIVER.format(here=here, port=port)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    heard = {line[1]: np.array(line[2:], float) for line in lines if line[0] == "bone"}
    sent = unity_bones(messages(VmcEncoder(SKELETON)(2.5, pose(6))))
    assert heard.keys() == sent.keys()
    for name, values in heard.items():
        assert np.allclose(values[:3], sent[name][0], atol=1e-6)
        assert np.allclose(Rotation.from_quat(values[3:]).as_matrix(), sent[name][1], atol=1e-6)
    assert ["time", "2.5"] in lines
    assert ["state", "1"] in lines
