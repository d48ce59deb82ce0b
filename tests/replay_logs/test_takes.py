"""Takes give back what was recorded, whole or cut off, and play back as devices."""

import json
import resource
import time
from dataclasses import replace
from io import BytesIO

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from devices.driver import Driver, RawChunk, Reading
from devices.errors import FileError, SettingError
from devices.filters import GateSettings, OneEuroSettings
from devices.protocols import make_protocol
from devices.room import RoomTransform
from devices.sample import ROLES, TrackerSample
from replay_logs.player import TakePlayer, players
from replay_logs.recorder import TakeRecorder
from replay_logs.take import Mark, RecordedDevice, Take, read_take
from tests.devices.motions import waving
from tests.replay_logs.recordings import START_NS, read_out, record_simulated

DEVICE = RecordedDevice(
    "suit", "generic", {"axes": "FLU"}, {"1": "head"}, RoomTransform((0.0, 0.6, 0.0, 0.8), (1.0, 0.0, -2.0)),
    GateSettings(10.0, 3, 0.5), OneEuroSettings(1.0, 2.0, 3.0),
)  # fmt: skip


def read_or_none(path) -> Take | None:
    """The take, or None where nothing of it can be read and one line says so."""
    try:
        return read_take(path)
    except FileError as error:
        return None if "\n" not in str(error) else pytest.fail(str(error))


def test_a_take_gives_back_samples_bytes_and_what_made_it(tmp_path):
    path = tmp_path / "a.mcap"
    recorded = record_simulated(path, waving(2, 1.0), {"1": "root", "2": "head"}, metadata={"session": "x = 1"})
    take = read_take(path)
    assert take.missing is None
    assert list(take.samples(take.devices[0])) == recorded.samples
    assert take.chunks["suit"] == tuple(recorded.chunks)
    assert take.metadata["session"] == "x = 1"
    assert take.metadata["software"].startswith("sixpoint ")
    assert take.duration_s == pytest.approx(1.0, abs=1e-6)


def test_a_device_is_described_completely():
    bare = replace(DEVICE, gate=None, smoothing=None)
    for device in (DEVICE, bare):
        assert RecordedDevice.from_metadata(device.to_metadata()) == device


def test_other_tools_find_poses_in_it(tmp_path):
    path = tmp_path / "a.mcap"
    recorded = record_simulated(path, waving(2, 0.5), {"1": "root", "2": "head"})
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        poses = [(s, c, m) for s, c, m in reader.iter_messages() if c.topic.startswith("/trackers/")]
    assert len(poses) == len(recorded.samples)
    schema, channel, message = poses[0]
    assert (schema.name, schema.encoding, channel.message_encoding) == ("foxglove.PoseInFrame", "jsonschema", "json")
    pose = json.loads(message.data)
    first = recorded.samples[0]
    assert pose["frame_id"] == "suit"
    assert pose["timestamp"]["sec"] * 10**9 + pose["timestamp"]["nsec"] == first.host_time_ns
    assert tuple(pose["pose"]["position"].values()) == pytest.approx(first.position, abs=1e-6)
    assert tuple(pose["pose"]["orientation"].values()) == pytest.approx(first.orientation, abs=1e-6)


def test_the_index_of_a_take_is_packed_and_other_tools_seek_by_it(tmp_path):
    assert isinstance(Writer(BytesIO())._Writer__chunk_indices, list)
    path = tmp_path / "a.mcap"
    record_simulated(path, waving(1, 3.0), {"1": "root"})
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
        assert summary.statistics.chunk_count == len(summary.chunk_indexes) > 10
        middle = START_NS + 1_500_000_000
        found = list(make_reader(file).iter_messages(starting_at=middle, ending_before=middle + 500_000_000))
    assert 29 <= len([message for _, channel, message in found if channel.topic == "/devices/suit/raw"]) <= 32


def test_marks_stand_in_a_take_and_other_tools_read_them_as_a_log(tmp_path):
    path = tmp_path / "a.mcap"
    marks = (Mark(START_NS + 250_000_000, 'the "jump", à gauche'), Mark(START_NS + 1, ""))
    with TakeRecorder(path) as recorder:
        recorder.add_device(RecordedDevice("suit", "generic"))
        recorder.write("suit", Reading((RawChunk(START_NS, b""),)))
        for mark in marks:
            recorder.mark(mark.time_ns, mark.text)
    assert read_take(path).marks == marks
    with path.open("rb") as file:
        told = list(make_reader(file, validate_crcs=True).iter_messages(topics=["/marks"], log_time_order=False))
    schemas, texts = {s.name for s, _, _ in told if s}, [json.loads(m.data)["message"] for _, _, m in told]
    assert (schemas, texts) == ({"foxglove.Log"}, [mark.text for mark in marks])


def test_a_take_cut_at_any_byte_opens_up_to_its_last_whole_chunk(tmp_path):
    path, cut = tmp_path / "a.mcap", tmp_path / "cut.mcap"
    recorded = record_simulated(path, waving(1, 1.0), {"1": "root"})
    whole = path.read_bytes()
    longest = 0
    for length in range(0, len(whole), 13):
        cut.write_bytes(whole[:length])
        take = read_or_none(cut)
        if take is None:
            assert longest == 0
            continue
        samples = list(take.samples(take.devices[0]))
        assert samples == recorded.samples[: len(samples)]
        assert len(samples) >= longest
        assert f"cut off or damaged at byte {len(whole) - 8}" in take.missing or length < len(whole) - 8
        longest = len(samples)
    assert longest == len(recorded.samples)


def test_damage_is_never_taken_for_data_wherever_it_is(tmp_path):
    path = tmp_path / "a.mcap"
    recorded = record_simulated(path, waving(1, 1.0), {"1": "root"})
    whole = path.read_bytes()
    # The summary at the end repeats what stands before it, and is not needed.
    data_end = whole.rindex(b"\x0f\x04" + bytes(7))
    for at in range(0, data_end, 41):
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        path.write_bytes(damaged)
        take = read_or_none(path)
        if take is None:
            continue
        samples = list(take.samples(take.devices[0]))
        assert take.missing is not None, at
        assert samples == recorded.samples[: len(samples)]


def test_what_a_crash_leaves_lacks_at_most_a_quarter_of_a_second(tmp_path):
    path = tmp_path / "a.mcap"
    protocol = make_protocol("generic")
    simulated = protocol.simulator(["root"])
    recorder = TakeRecorder(path)
    recorder.add_device(replace(DEVICE, options={}))
    for tick in range(300):
        now_ns = 10**9 + tick * 16_666_667
        packet = simulated.measure([sample_at(now_ns)])[0]
        recorder.write("suit", Reading((RawChunk(now_ns, packet),), tuple(protocol.feed(packet, now_ns))))
        if tick > 20 and tick % 37 == 0:
            kept = read_take(path)
            assert now_ns - kept.chunks["suit"][-1].host_time_ns <= 250_000_000
    recorder.close()
    assert len(read_take(path).chunks["suit"]) == 300


def sample_at(now_ns: int) -> TrackerSample:
    return TrackerSample("1", now_ns, (0.1, 1.0, 0.2), (0.0, 0.0, 0.0, 1.0), now_ns * 1e-9)


@pytest.mark.parametrize("content", [b"", b"not a take at all", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + bytes(100)])
def test_what_is_no_take_is_said_so(tmp_path, content):
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"a\.mcap: (not a take|no device's bytes)"):
        read_take(path)


def test_takes_are_not_overwritten_and_need_a_folder(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_text("mine")
    with pytest.raises(FileError, match="a file already"):
        TakeRecorder(path)
    assert path.read_text() == "mine"
    with pytest.raises(FileError, match="cannot be written"):
        TakeRecorder(tmp_path / "none" / "a.mcap")


def test_a_full_disk_is_one_line_and_what_was_kept_opens(tmp_path):
    path = tmp_path / "a.mcap"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(FileError, match="recording stopped") as caught:
            record_simulated(path, waving(6, 10.0), dict(zip("123456", ROLES, strict=True)))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "\n" not in str(caught.value)
    take = read_take(path)
    assert take.missing is not None
    assert take.duration_s > 0.1


def test_two_devices_of_one_name_are_refused(tmp_path):
    with TakeRecorder(tmp_path / "a.mcap") as recorder:
        recorder.add_device(DEVICE)
        with pytest.raises(SettingError, match="suit"):
            recorder.add_device(DEVICE)


def test_a_player_is_a_device_and_gives_the_same_samples(tmp_path):
    path = tmp_path / "a.mcap"
    recorded = record_simulated(path, waving(2, 1.0), {"1": "root", "2": "head"})
    take = read_take(path)
    player = TakePlayer(take, take.devices[0], speed=None)
    assert isinstance(player, Driver)
    assert read_out(player).samples == recorded.samples
    player.open()
    again = read_out(player)
    assert again.samples == recorded.samples
    assert again.chunks == recorded.chunks


def test_a_player_keeps_time_at_its_speed(tmp_path):
    path = tmp_path / "a.mcap"
    recorded = record_simulated(path, waving(1, 1.0), {"1": "root"})
    (player,) = players(read_take(path), speed=5.0)
    player.open()
    played = read_out(player)
    assert [s.position for s in played.samples] == [s.position for s in recorded.samples]
    assert (played.samples[-1].host_time_ns - played.samples[0].host_time_ns) * 1e-9 == pytest.approx(0.2, abs=1e-6)
    assert time.perf_counter_ns() >= played.samples[-1].host_time_ns
