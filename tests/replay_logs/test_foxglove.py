"""What other programs find in a take: well-known messages, as their own schemas say, in frames that hang together."""

import json
from collections import defaultdict

import numpy as np
import pytest
from mcap.reader import make_reader
from scipy.spatial.transform import Rotation

from devices.driver import RawChunk, Reading
from devices.room import RoomTransform
from devices.sample import ROLES, TrackerSample
from replay_logs.foxglove import LOG_SCHEMA, POSE_SCHEMA, TRANSFORM_SCHEMA
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice, read_take

jsonschema = pytest.importorskip("jsonschema", reason="the package jsonschema is not installed")

FIELDS = {
    "foxglove.PoseInFrame": {"timestamp", "frame_id", "pose"},
    "foxglove.FrameTransform": {"timestamp", "parent_frame_id", "child_frame_id", "translation", "rotation"},
    "foxglove.Log": {"timestamp", "level", "message", "name", "file", "line"},
}
"""What Foxglove's schema documents require."""
ROOMS = {
    "left": RoomTransform((0.0, 0.6, 0.0, 0.8), (1.0, 0.5, -2.0)),
    "right": RoomTransform((0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("foxglove") / "a.mcap"
    rng = np.random.default_rng(2)
    with TakeRecorder(path) as recorder:
        for number, (name, room) in enumerate(ROOMS.items()):
            recorder.add_device(RecordedDevice(name, "generic", {}, {"1": ROLES[number]}, room, gate=None))
        for step in range(5):
            now_ns = 7_000_000_000 + step * 16_000_000
            for name in ROOMS:
                turn = tuple(float(v) for v in Rotation.random(rng=rng).as_quat()) if name == "left" else None
                sample = TrackerSample("1", now_ns, tuple(rng.normal(size=3).tolist()), turn)
                recorder.write(name, Reading((RawChunk(now_ns, b"x"),), (sample,)))
            recorder.mark(now_ns, f"step {step}")
    return path


@pytest.fixture(scope="module")
def messages(path):
    """By schema: (topic, message) in the order of the file, each checked by the schema that stands in the take."""
    found = defaultdict(list)
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            if channel.message_encoding == "json" and schema is not None:
                assert schema.encoding == "jsonschema"
                values = json.loads(message.data)
                jsonschema.validate(values, json.loads(schema.data))
                assert values["timestamp"] == dict(zip(("sec", "nsec"), divmod(message.log_time, 10**9), strict=True))
                found[schema.name].append((channel.topic, values))
    return found


def test_messages_have_the_names_and_fields_of_the_schema_documents(messages):
    assert set(messages) == set(FIELDS)
    for schema in (POSE_SCHEMA, TRANSFORM_SCHEMA, LOG_SCHEMA):
        assert set(schema["required"]) == FIELDS[schema["title"]]
        jsonschema.Draft202012Validator.check_schema(schema)
        assert all(set(values) == FIELDS[schema["title"]] for _, values in messages[schema["title"]])


def placed(transform, point):
    """By the document: `p_parent = R p_child + t`."""
    rotation = Rotation.from_quat([transform["rotation"][axis] for axis in "xyzw"])
    return rotation.apply(point) + [transform["translation"][axis] for axis in "xyz"]


def test_every_sample_lies_in_a_frame_that_hangs_on_the_root(messages, path):
    frames = {values["child_frame_id"]: values for _, values in messages["foxglove.FrameTransform"]}
    assert set(frames) == {"room", *ROOMS}
    assert [frames[name]["parent_frame_id"] for name in ("room", *ROOMS)] == ["world", "room", "room"]
    first_pose = min(values["timestamp"]["nsec"] for _, values in messages["foxglove.PoseInFrame"])
    assert all(values["timestamp"]["nsec"] <= first_pose for values in frames.values())
    for topic, values in messages["foxglove.PoseInFrame"]:
        assert topic == f"/trackers/{values['frame_id']}/1"
        here = np.array([values["pose"]["position"][axis] for axis in "xyz"])
        in_room = placed(frames[values["frame_id"]], here)
        assert in_room == pytest.approx(ROOMS[values["frame_id"]].point(tuple(here)), abs=1e-9)
        in_world = placed(frames["room"], in_room)
        assert in_world == pytest.approx([in_room[0], -in_room[2], in_room[1]], abs=1e-9)


def test_what_is_for_others_is_not_read_back(path):
    take = read_take(path)
    assert [len(chunks) for chunks in take.chunks.values()] == [5, 5]
    assert [mark.text for mark in take.marks] == [f"step {step}" for step in range(5)]
