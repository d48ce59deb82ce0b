"""Takes trimmed, merged, converted and written again: nothing that counts changes by a bit."""

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.driver import RawChunk, Reading
from devices.errors import FileError, SettingError
from devices.filters import OneEuroSettings
from devices.protocols import make_protocol, protocols
from devices.sample import ROLES, TrackerSample
from devices.simulators.source import measurements
from replay_logs.converting import csv_to_take, role_readings, take_to_csv, take_to_npz
from replay_logs.csv_tracks import read_tracks_csv, write_tracks_csv
from replay_logs.frames import load_frames, take_frames
from replay_logs.golden_takes import FOLDER
from replay_logs.merging import GAP_S, merged
from replay_logs.recorder import TakeRecorder
from replay_logs.rewriting import write_take
from replay_logs.span import Span
from replay_logs.take import RecordedDevice, Take, read_take
from replay_logs.trimming import trimmed
from tests.devices.motions import waving
from tests.replay_logs.recordings import START_NS

every_golden_take = pytest.mark.parametrize("path", sorted(FOLDER.glob("*.mcap")), ids=lambda path: path.stem)
SECONDS = 4.0


@pytest.fixture(scope="module")
def tuned(tmp_path_factory) -> Take:
    """Two suits, the filters of one changed on the way, with marks."""
    path = tmp_path_factory.mktemp("tuned") / "tuned.mcap"
    halves = {"upper": ROLES[1:4], "lower": (ROLES[0], *ROLES[4:])}
    with TakeRecorder(path, {"session": "[performer]\nheight_m = 1.8\n"}) as recorder:
        spoken = {}
        for name, roles in halves.items():
            spoken[name] = make_protocol("generic"), make_protocol("generic").simulator(roles)
            assignment = {str(i): role for i, role in enumerate(roles, 1)}
            recorder.add_device(RecordedDevice(name, "generic", {}, assignment, smoothing=OneEuroSettings()))
            recorder.write(name, Reading((RawChunk(START_NS, b""),)))
        for number, (time_s, told) in enumerate(measurements(waving(3, SECONDS), 60)):
            now_ns = START_NS + round(time_s * 1e9)
            if number == 90:
                recorder.settings(now_ns, {"device.lower.min_cutoff_hz": 1.0, "device.upper.smooth": False})
                recorder.mark(now_ns, "calmer")
            if number == 150:
                recorder.settings(now_ns, {"device.lower.beta": 5.0})
            for name, (protocol, simulated) in spoken.items():
                data = b"".join(simulated.measure(told))
                samples = tuple(protocol.feed(data, now_ns))
                recorder.write(name, Reading((RawChunk(now_ns, data[:50]), RawChunk(now_ns, data[50:])), samples))
    return read_take(path)


def same_take(a: Take, b: Take) -> bool:
    """All but where the files are."""
    return replace(a, path=b.path, missing=b.missing) == b


def same_frames(these, those) -> bool:
    """Whether the trackers are the same bit for bit, whatever the time is counted from."""
    return len(these) == len(those) and all(
        np.array_equal(a.positions, b.positions, equal_nan=True)
        and np.array_equal(a.orientations, b.orientations, equal_nan=True)
        and np.array_equal(a.states, b.states)
        for a, b in zip(these, those, strict=True)
    )


@every_golden_take
def test_a_take_written_again_is_the_same(path, tmp_path):
    take = read_take(path)
    write_take(take, tmp_path / "again.mcap")
    again = read_take(tmp_path / "again.mcap")
    assert same_take(take, again)
    assert again.readings() == take.readings()


def test_marks_and_changes_stand_where_they_stood(tuned, tmp_path):
    write_take(tuned, tmp_path / "again.mcap")
    again = read_take(tmp_path / "again.mcap")
    assert same_take(tuned, again)
    assert len(again.changes) == 2
    assert again.readings() == tuned.readings()


def test_a_damaged_take_is_mended_up_to_its_damage(tuned, tmp_path):
    cut = tmp_path / "cut.mcap"
    whole = tuned.path.read_bytes()
    cut.write_bytes(whole[: len(whole) // 2])
    take = read_take(cut)
    assert take.missing
    write_take(take, tmp_path / "mended.mcap")
    mended = read_take(tmp_path / "mended.mcap")
    assert mended.missing is None
    assert same_take(take, mended)


def test_nothing_is_overwritten_and_nothing_left_behind(tuned, tmp_path):
    there = tmp_path / "there.mcap"
    there.write_bytes(b"something")
    for write in (lambda: write_take(tuned, there), lambda: csv_to_take(written_tracks(tmp_path), there)):
        with pytest.raises(FileError, match="not overwritten"):
            write()
    with pytest.raises(FileError, match="cannot be written"):
        write_take(tuned, tmp_path / "missing" / "a.mcap")
    assert there.read_bytes() == b"something"


def frames_within(take: Take, fps: float, from_s: float, to_s: float) -> list:
    """The frames of the whole take between two moments, by their number."""
    first, last = int(np.ceil(from_s * fps - 1e-6)), int(np.floor(to_s * fps + 1e-6))
    return take_frames(take, fps)[first : last + 1]


@every_golden_take
@pytest.mark.parametrize(("from_s", "to_s"), [(0.0, 1.0), (0.7, 1.4), (1.55, 2.6)])
def test_a_trimmed_take_has_the_frames_of_the_whole(path, from_s, to_s, tmp_path):
    take = read_take(path)
    write_take(trimmed(take, from_s, to_s).take, tmp_path / "part.mcap")
    for fps in (60.0, 30.0):
        part = load_frames(tmp_path / "part.mcap", fps)
        assert same_frames(part, frames_within(take, fps, from_s, to_s))
        assert part[0].time_s == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=12, deadline=None)
@given(st.floats(0, SECONDS - 0.3), st.floats(0.1, SECONDS), st.sampled_from([24.0, 60.0, 120.0]))
def test_wherever_it_is_cut_and_whatever_was_changed(tuned, from_s, length_s, fps):
    to_s = min(from_s + length_s, SECONDS - 0.1)
    part = trimmed(tuned, from_s, to_s).take
    assert same_frames(take_frames(part, fps), frames_within(tuned, fps, from_s, to_s))


def test_a_part_of_a_part_is_the_part(tuned):
    once = trimmed(tuned, 1.0, 3.0).take
    twice = trimmed(trimmed(tuned, 0.5, 3.5).take, 0.5, 2.5).take
    assert Span.of(once) == Span.of(twice)
    assert same_frames(take_frames(once, 60), take_frames(twice, 60))


def test_what_is_cut_away_is_gone_but_for_a_lead_in(tuned):
    part = trimmed(tuned, 0.5, 1.0)
    assert all(len(held) < 0.6 * len(tuned.chunks[name]) for name, held in part.take.chunks.items())
    assert part.take.marks == ()
    assert trimmed(tuned, 1.0).take.marks == tuned.marks
    late = trimmed(read_take(FOLDER / "demo.mcap"), 20.0, 21.0)
    assert 0.5 < late.lead_in_s < 2.0


@pytest.mark.parametrize(("from_s", "to_s"), [(-1.0, 2.0), (2.0, 1.0), (99.0, None), (1.0, 1.0)])
def test_a_trim_of_nothing_says_how_long_the_take_is(tuned, from_s, to_s):
    with pytest.raises(SettingError, match=r"from 0 to 4\.00 s"):
        trimmed(tuned, from_s, to_s)


def parted(take: Take, name: str) -> Take:
    """The take with that device alone."""
    changes = tuple(replace(c, chunks_before={name: c.chunks_before[name]}) for c in take.changes)
    only = tuple(device for device in take.devices if device.name == name)
    return replace(take, devices=only, chunks={name: take.chunks[name]}, changes=changes)


def test_devices_recorded_apart_are_merged_side_by_side(tuned, tmp_path):
    both = merged(parted(tuned, "upper"), parted(tuned, "lower"))
    assert "one machine's run" in both.told
    assert sorted(both.take.readings(), key=repr) == sorted(tuned.readings(), key=repr)
    write_take(both.take, tmp_path / "both.mcap")
    assert same_frames(load_frames(tmp_path / "both.mcap", 60), take_frames(tuned, 60))


def test_a_take_after_another_is_both_with_a_gap(tuned):
    again = merged(tuned, tuned, "after")
    length_s = take_frames(tuned, 60)[-1].time_s
    frames = take_frames(again.take, 60)
    assert again.take.devices == tuned.devices + tuple(replace(d, name=f"{d.name}_2") for d in tuned.devices)
    assert same_frames(frames[: len(take_frames(tuned, 60))], take_frames(tuned, 60))
    assert frames[-1].time_s == pytest.approx(2 * length_s + GAP_S, abs=0.02)
    assert not any(f.measured.any() for f in frames if length_s + 0.1 < f.time_s < length_s + GAP_S - 0.1)


def test_a_device_that_goes_on_is_one_device():
    take = read_take(FOLDER / "fastrak.mcap")
    both = merged(take, take, "after").take
    assert both.devices == take.devices
    assert len(both.readings()) == 2 * len(take.readings())
    assert [r.position for r in both.readings()] == 2 * [r.position for r in take.readings()]


def test_takes_of_two_machines_are_matched_by_the_time_of_day():
    take = read_take(FOLDER / "fastrak.mcap")
    other = replace(
        read_take(FOLDER / "generic.mcap"),
        metadata={**take.metadata, "created": "2030-01-01T00:00:01+00:00"},
    )
    take = replace(take, metadata={**take.metadata, "created": "2030-01-01T00:00:00+00:00"})
    assert "one machine's run" in merged(take, other).told
    far = replace(other, metadata={**other.metadata, "created": "2030-01-01T02:00:00+00:00"})
    assert "after the end" in merged(take, far).told
    with pytest.raises(SettingError, match="do not overlap"):
        merged(take, far, "parallel")
    told = merged(take, far, offset_s=0.5)
    assert "0.5 s after" in told.told
    assert "mixed" in told.told
    starts = [told.take.chunks[name][0].host_time_ns for name in ("fastrak", "generic")]
    assert starts[1] - starts[0] == 500_000_000
    assert merged(take, other, "parallel").take.chunks["generic"][0].host_time_ns == starts[0]


def test_wrong_merges_are_refused(tuned):
    with pytest.raises(SettingError, match="auto, parallel, after"):
        merged(tuned, tuned, "sideways")
    with pytest.raises(SettingError, match="merge the whole ones"):
        merged(trimmed(tuned, 1.0, 2.0).take, tuned)


def written_tracks(folder: Path, orientations: bool = True) -> Path:
    path, rng = folder / "tracks.csv", random.Random(3)
    samples = []
    for step in range(40):
        for role in ROLES[: 2 + step % 5]:
            place = tuple(rng.uniform(-20, 20) for _ in range(3))
            turn = tuple(rng.gauss(0, 1) for _ in range(4))
            length = sum(v * v for v in turn) ** 0.5
            turn = tuple(v / length for v in turn) if orientations and role != "head" else None
            samples.append(TrackerSample(role, step * 16_667_000, place, turn, quality=round(rng.random(), 2)))
    write_tracks_csv(path, samples)
    return path


@pytest.mark.parametrize("orientations", [True, False])
def test_tracks_become_a_take_and_tracks_again_to_the_digit(orientations, tmp_path):
    tracks = written_tracks(tmp_path, orientations)
    csv_to_take(tracks, tmp_path / "a.mcap")
    take = read_take(tmp_path / "a.mcap")
    take = replace(take, devices=tuple(replace(device, gate=None) for device in take.devices))
    take_to_csv(take, tmp_path / "b.csv")
    there, back = (read_tracks_csv(path) for path in (tracks, tmp_path / "b.csv"))
    assert [(s.tracker, s.host_time_ns, s.position) for s in back] == [
        (s.tracker, s.host_time_ns, s.position) for s in there
    ]
    for one, other in zip(there, back, strict=True):
        assert (one.orientation is None) == (other.orientation is None)
        assert one.orientation is None or np.allclose(one.orientation, other.orientation, atol=2e-6)
    if not orientations:
        assert same_frames(load_frames(tracks, 60), load_frames(tmp_path / "a.mcap", 60))


def test_a_position_beyond_the_protocol_is_refused(tmp_path):
    write_tracks_csv(tmp_path / "far.csv", [TrackerSample("head", 0, (60.0, 0.0, 0.0))])
    with pytest.raises(FileError, match="beyond any room"):
        csv_to_take(tmp_path / "far.csv", tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()


@every_golden_take
def test_arrays_and_tables_of_a_take_are_its_readings(path, tmp_path):
    take = read_take(path)
    take_to_npz(take, tmp_path / "a.npz")
    take_to_csv(take, tmp_path / "a.csv")
    with np.load(tmp_path / "a.npz") as arrays:
        rows = list(zip(arrays["role"].tolist(), arrays["host_time_ns"].tolist(), strict=True))
        assert rows == [(r.role, r.host_time_ns) for r in take.readings()]
        assert np.array_equal(arrays["positions_m"], np.array([r.position for r in take.readings()]))
        assert tuple(arrays["roles"]) == ROLES
    tracks = read_tracks_csv(tmp_path / "a.csv")
    newest = {(r.role, (r.host_time_ns - rows[0][1] + 500) // 1000): r for r in take.readings()}
    assert len(tracks) == len(newest)
    for sample in tracks:
        reading = newest[ROLES.index(sample.tracker), sample.host_time_ns // 1000]
        assert np.allclose(sample.position, reading.position, atol=5.1e-7)


def test_only_the_span_of_a_trimmed_take_is_converted(tuned, tmp_path):
    part = trimmed(tuned, 1.0, 2.0).take
    assert role_readings(part) == [r for r in tuned.readings() if r.host_time_ns in Span.of(part)]
    take_to_csv(part, tmp_path / "part.csv")
    assert read_tracks_csv(tmp_path / "part.csv")[-1].host_time_ns <= 1_000_000_000


def test_every_protocol_is_among_the_golden_takes():
    assert set(protocols()) <= {path.stem for path in FOLDER.glob("*.mcap")}
