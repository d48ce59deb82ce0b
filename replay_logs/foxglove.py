"""What a take holds for other programs: well-known messages of Foxglove's in JSON, with their schemas.

After the JSON schemas of foxglove-sdk (github.com/foxglove/foxglove-sdk, schemas/jsonschema): names, fields and what is
required are theirs. Samples lie in the frame of their device; frames say where that is. The root frame has Z up, as
viewers take it, and `room` in it has Y up, as everything here.
"""

import json
import math
from collections.abc import Mapping

from devices.room import RoomTransform
from devices.sample import TrackerSample

FRAMES_TOPIC = "/frames"
WORLD_FRAME, ROOM_FRAME = "world", "room"
_NUMBER = {"type": "number"}
_TEXT = {"type": "string"}
_INFO = 2
"""`foxglove.LogLevel` of what is told, no warning."""


def _object(**properties: object) -> dict[str, object]:
    return {"type": "object", "properties": properties, "required": list(properties)}


def _whole(**bounds: int) -> dict[str, object]:
    return {"type": "integer", "minimum": 0, **bounds}


_TIME = {"title": "time", **_object(sec=_whole(), nsec=_whole(maximum=999_999_999))}
_VECTOR = {"title": "foxglove.Vector3", **_object(x=_NUMBER, y=_NUMBER, z=_NUMBER)}
_QUATERNION = {"title": "foxglove.Quaternion", **_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)}

POSE_SCHEMA: Mapping[str, object] = {
    "title": "foxglove.PoseInFrame",
    **_object(
        timestamp=_TIME,
        frame_id=_TEXT,
        pose={"title": "foxglove.Pose", **_object(position=_VECTOR, orientation=_QUATERNION)},
    ),
}
TRANSFORM_SCHEMA: Mapping[str, object] = {
    "title": "foxglove.FrameTransform",
    **_object(timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR, rotation=_QUATERNION),
}
LOG_SCHEMA: Mapping[str, object] = {
    "title": "foxglove.Log",
    **_object(timestamp=_TIME, level=_whole(maximum=5), message=_TEXT, name=_TEXT, file=_TEXT, line=_whole()),
}

_HALF = math.sqrt(0.5)
UPRIGHT = (WORLD_FRAME, ROOM_FRAME, RoomTransform((_HALF, 0.0, 0.0, _HALF)))
"""The room's frame in the root's: a quarter turn about X takes Y up to Z up."""


def pose_message(frame: str, sample: TrackerSample) -> bytes:
    """A sample as a `foxglove.PoseInFrame`; without an orientation it is the identity."""
    x, y, z = sample.position or (0.0, 0.0, 0.0)
    qx, qy, qz, qw = sample.orientation or (0.0, 0.0, 0.0, 1.0)
    sec, nsec = divmod(sample.host_time_ns, 1_000_000_000)
    # Written out: it is done for each sample, and this takes a quarter of the time of `json.dumps`.
    return (
        f'{{"timestamp":{{"sec":{sec},"nsec":{nsec}}},"frame_id":{json.dumps(frame)},'
        f'"pose":{{"position":{{"x":{x:.6f},"y":{y:.6f},"z":{z:.6f}}},'
        f'"orientation":{{"x":{qx:.6f},"y":{qy:.6f},"z":{qz:.6f},"w":{qw:.6f}}}}}}}'
    ).encode()


def mark_message(time_ns: int, text: str) -> bytes:
    """A mark as a `foxglove.Log`."""
    told = {"timestamp": _stamp(time_ns), "level": _INFO, "message": text, "name": "mark", "file": "", "line": 0}
    return json.dumps(told).encode()


def frame_message(time_ns: int, parent: str, child: str, placed: RoomTransform) -> bytes:
    """Where a frame lies in another, `p_parent = R p_child + t`, as a `foxglove.FrameTransform`."""
    return json.dumps(
        {
            "timestamp": _stamp(time_ns),
            "parent_frame_id": parent,
            "child_frame_id": child,
            "translation": dict(zip("xyz", placed.translation, strict=True)),
            "rotation": dict(zip("xyzw", placed.rotation, strict=True)),
        }
    ).encode()


def _stamp(time_ns: int) -> dict[str, int]:
    sec, nsec = divmod(time_ns, 1_000_000_000)
    return {"sec": sec, "nsec": nsec}
