"""Poses out over UDP while they are made: VMC and VRChat trackers over OSC, and plain JSON. See `docs/streams.md`.

An encoder turns one pose into datagrams and does no input or output; `PoseStream` sends them. Unity's world, which VMC
and VRChat use, is left-handed with the performer's left at -X: ours mirrored in X.
"""

import json
import socket
import struct
import time
from collections.abc import Callable, Sequence
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from capture.vrm_pose import humanoid_parents, t_pose
from devices.errors import SettingError, choice_error
from devices.progress import Progress, no_progress
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Motion, Pose
from reconstruction.skeleton import Skeleton

Encoder = Callable[[float, NDArray[np.float64]], list[bytes]]
"""Called with seconds since the start and `T_world_joint` (J, 4, 4); gives the datagrams of that moment."""

_MOST_BYTES = 1400
"""Largest OSC datagram: below what an Ethernet frame carries."""
_MIRROR = np.array([-1.0, 1.0, 1.0])
_MIRROR_TURN = np.array([1.0, -1.0, -1.0, 1.0])
"""A mirror in X, of positions and of quaternions (x, y, z, w)."""


class PoseStream:
    """One destination. `send` never waits: what the network does not take at once is dropped and counted."""

    def __init__(self, host: str, port: int, encode: Encoder) -> None:
        """Raises OSError where the host is unknown."""
        family, kind, protocol, _, self._address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)
        self._encode = encode
        self.sent = self.dropped = 0

    def send(self, time_s: float, joints: NDArray[np.float64]) -> None:
        """Sends one pose. joints: `T_world_joint` (J, 4, 4)."""
        for datagram in self._encode(time_s, joints):
            try:
                self._socket.sendto(datagram, self._address)
                self.sent += 1
            except OSError:  # nobody listens, or the queue is full: the next pose comes soon enough
                self.dropped += 1

    def close(self) -> None:
        """Ends the stream."""
        self._socket.close()


def open_stream(address: str, skeleton: Skeleton, reference: Pose | None = None) -> PoseStream:
    """The stream that an address like `vmc://127.0.0.1:39539` names.

    Schemes: `vmc` (port 39539 by default), `vrchat` (9000), `json` (6060). reference: any standing pose, needed for
    skeletons whose rest pose is no pose of a person. Raises SettingError for another scheme, a wrong port or an unknown
    host.
    """
    try:
        parts = urlsplit(address)
        port = parts.port
    except ValueError as error:
        raise SettingError(f"stream {address!r}: {error}; write it like vmc://127.0.0.1:39539") from error
    if parts.scheme not in _SCHEMES:
        raise choice_error("stream scheme", parts.scheme, _SCHEMES)
    encoder, usual_port = _SCHEMES[parts.scheme]
    host = parts.hostname or "127.0.0.1"
    try:
        return PoseStream(host, port or usual_port, encoder(skeleton, reference))
    except socket.gaierror as error:
        raise SettingError(
            f"stream {address!r}: no host {host!r} is known; write it like vmc://127.0.0.1:39539"
        ) from error


def stream_motion(
    motion: Motion, streams: Sequence[PoseStream], loop: bool = False, progress: Progress = no_progress
) -> None:
    """Sends a motion's poses at their own times, once or, with `loop`, until it is interrupted."""
    joints = world_transforms(motion.skeleton, motion.root_positions, motion.rotations)
    start, number = time.perf_counter(), 0
    while loop or number < len(motion):
        due = number / motion.fps
        time.sleep(max(start + due - time.perf_counter(), 0.0))
        for stream in streams:
            stream.send(due, joints[number % len(motion)])
        number += 1
        progress((number - 1) % len(motion) + 1, len(motion))


class VmcEncoder:
    """Virtual Motion Capture protocol 2.0, as a performer: the availability, the root and every humanoid bone.

    Rotations are those of a VRM skeleton: each bone's turn away from the T-pose, seen from its parent bone.
    """

    def __init__(self, skeleton: Skeleton, reference: Pose | None = None) -> None:
        self._bones = sorted(skeleton.humanoid, key=lambda bone: skeleton.humanoid[bone])
        self._joints = np.array([skeleton.humanoid[bone] for bone in self._bones])
        self._parents = humanoid_parents(skeleton, self._joints)
        rest, positions = t_pose(skeleton, reference)
        self._rest_inverse = rest[self._joints].transpose(0, 2, 1)
        offsets = positions[self._joints] - positions[self._joints[np.maximum(self._parents, 0)]]
        self._offsets = offsets * _MIRROR
        self._heads = [_message("/VMC/Ext/Bone/Pos", "sfffffff", _text(_unity_name(bone))) for bone in self._bones]
        root = _message("/VMC/Ext/Root/Pos", "sfffffff", _text("root")) + struct.pack(">7f", 0, 0, 0, 0, 0, 0, 1)
        self._before = [_message("/VMC/Ext/OK", "i", struct.pack(">i", 1)), root]
        self._time = _message("/VMC/Ext/T", "f", b"")

    def __call__(self, time_s: float, joints: NDArray[np.float64]) -> list[bytes]:
        turned = joints[self._joints, :3, :3] @ self._rest_inverse
        local = turned[np.maximum(self._parents, 0)].transpose(0, 2, 1) @ turned
        top = self._parents < 0
        local[top] = turned[top]
        places = self._offsets.copy()
        places[top] = joints[self._joints[top], :3, 3] * _MIRROR
        quaternions = Rotation.from_matrix(local).as_quat(canonical=True) * _MIRROR_TURN
        values = np.concatenate([places, quaternions], axis=1).astype(">f4")
        bones = [head + value.tobytes() for head, value in zip(self._heads, values, strict=True)]
        return _bundles([*self._before, *bones, self._time + struct.pack(">f", time_s)])


class VrchatEncoder:
    """VRChat's OSC trackers: hips, chest, feet, knees and elbows as trackers 1 to 8, and the head for alignment.

    Each has a position (metres) and Euler angles (degrees, turned about Z, then X, then Y), all zero in the T-pose.
    """

    TRACKERS = (
        ("1", ("hips",)),
        ("2", ("upper_chest", "chest", "spine")),
        ("3", ("left_foot",)),
        ("4", ("right_foot",)),
        ("5", ("left_lower_leg",)),
        ("6", ("right_lower_leg",)),
        ("7", ("left_lower_arm",)),
        ("8", ("right_lower_arm",)),
        ("head", ("head",)),
    )
    """Tracker by name, and the humanoid bones that may carry it, the best first."""

    def __init__(self, skeleton: Skeleton, reference: Pose | None = None) -> None:
        known = skeleton.humanoid
        found = [(name, next((known[b] for b in bones if b in known), None)) for name, bones in self.TRACKERS]
        carried = [(name, joint) for name, joint in found if joint is not None]
        self._joints = np.array([joint for _, joint in carried])
        self._rest_inverse = t_pose(skeleton, reference)[0][self._joints].transpose(0, 2, 1)
        self._heads = [
            [_message(f"/tracking/trackers/{name}/{what}", "fff", b"") for what in ("position", "rotation")]
            for name, _ in carried
        ]

    def __call__(self, time_s: float, joints: NDArray[np.float64]) -> list[bytes]:
        positions = (joints[self._joints, :3, 3] * _MIRROR).astype(">f4")
        mirror = np.diag(_MIRROR)
        turned = mirror @ joints[self._joints, :3, :3] @ self._rest_inverse @ mirror
        angles = _unity_euler(turned).astype(">f4")
        messages = [
            head + value.tobytes()
            for heads, *values in zip(self._heads, positions, angles, strict=True)
            for head, value in zip(heads, values, strict=True)
        ]
        return _bundles(messages)


class JsonEncoder:
    """One JSON object a datagram: version, running number, time and every joint in the world, in our own axes."""

    def __init__(self, skeleton: Skeleton, reference: Pose | None = None) -> None:
        self._names = skeleton.names
        self._number = 0

    def __call__(self, time_s: float, joints: NDArray[np.float64]) -> list[bytes]:
        quaternions = Rotation.from_matrix(joints[:, :3, :3]).as_quat(canonical=True)
        rows = np.concatenate([joints[:, :3, 3], quaternions], axis=1).round(5).tolist()
        body = {
            "version": 1,
            "number": self._number,
            "time_s": round(time_s, 6),
            "joints": dict(zip(self._names, rows, strict=True)),
        }
        self._number += 1
        return [json.dumps(body, separators=(",", ":")).encode()]


_SCHEMES: dict[str, tuple[Callable[[Skeleton, Pose | None], Encoder], int]] = {
    "vmc": (VmcEncoder, 39539),
    "vrchat": (VrchatEncoder, 9000),
    "json": (JsonEncoder, 6060),
}


def _unity_name(bone: str) -> str:
    """`left_lower_arm` is `LeftLowerArm` in Unity's HumanBodyBones, which VMC names bones by."""
    return "".join(part.capitalize() for part in bone.split("_"))


def _unity_euler(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) degrees about X, Y, Z of R = Ry Rx Rz (N, 3, 3), Unity's order; at the pole the angle about Z is zero."""
    about_x = np.arcsin(np.clip(-rotations[:, 1, 2], -1.0, 1.0))
    pole = np.abs(rotations[:, 1, 2]) > 1.0 - 1e-9
    about_y = np.arctan2(rotations[:, 0, 2], rotations[:, 2, 2])
    about_y = np.where(pole, np.arctan2(-rotations[:, 2, 0], rotations[:, 0, 0]), about_y)
    about_z = np.where(pole, 0.0, np.arctan2(rotations[:, 1, 0], rotations[:, 1, 1]))
    return np.degrees(np.stack([about_x, about_y, about_z], axis=1))


def _text(value: str) -> bytes:
    """An OSC string: zero-ended and filled up to a multiple of four bytes (OSC 1.0 specification)."""
    data = value.encode("ascii") + b"\0"
    return data + b"\0" * (-len(data) % 4)


def _message(address: str, types: str, arguments: bytes) -> bytes:
    return _text(address) + _text("," + types) + arguments


def _bundles(messages: Sequence[bytes]) -> list[bytes]:
    """OSC bundles to be done at once, each small enough for one frame of the network."""
    head = _text("#bundle") + struct.pack(">Q", 1)
    bundles, size = [bytearray(head)], len(head)
    for message in messages:
        if size + 4 + len(message) > _MOST_BYTES:
            bundles.append(bytearray(head))
            size = len(head)
        bundles[-1] += struct.pack(">i", len(message)) + message
        size += 4 + len(message)
    return [bytes(bundle) for bundle in bundles]
