"""Whole takes and tracks files as frames: how many there are, where, and what is missing."""

import numpy as np
import pytest

from devices.errors import FileError
from devices.frame import TrackerState
from devices.sample import ROLES, TrackerSample
from replay_logs.csv_tracks import write_tracks_csv
from replay_logs.frames import load_frames
from tests.devices.motions import waving
from tests.replay_logs.recordings import record_simulated

HEAD = ROLES.index("head")


def tracks(path, times, hidden=lambda t: False):
    """A head at (t, 1, 0)."""
    write_tracks_csv(path, [TrackerSample("head", round(t * 1e9), (t, 1.0, 0.0)) for t in times if not hidden(t)])


def test_one_frame_a_period_from_the_first_sample_to_the_last(tmp_path):
    path = tmp_path / "t.csv"
    tracks(path, [2 + i / 60 for i in range(121)])
    frames = load_frames(path, 60)
    assert len(frames) == 121
    assert [f.time_s for f in frames] == pytest.approx([2 + i / 60 for i in range(121)], abs=1e-9)
    assert [f.positions[HEAD, 0] for f in frames] == pytest.approx([f.time_s for f in frames], abs=1e-5)
    assert all(f.states[HEAD] == TrackerState.MEASURED for f in frames)


@pytest.mark.parametrize(("rate", "fps", "count"), [(30, 60, 241), (120, 60, 241), (100, 60, 241), (60, 25, 101)])
def test_other_rates_are_interpolated(tmp_path, rate, fps, count):
    path = tmp_path / "t.csv"
    tracks(path, [i / rate for i in range(4 * rate + 1)])
    frames = load_frames(path, fps)
    assert len(frames) == count
    assert [f.positions[HEAD, 0] for f in frames] == pytest.approx([i / fps for i in range(count)], abs=1e-5)


@pytest.mark.parametrize("rate", [30, 60, 120])
def test_lost_samples_are_missing_rows_even_a_single_one(tmp_path, rate):
    path = tmp_path / "t.csv"
    tracks(path, [i / rate for i in range(4 * rate + 1)], lambda t: 1.0 < t < 1.5 or abs(t - 3.0) < 1e-6)
    frames = load_frames(path, rate)
    missing = [f.time_s for f in frames if not f.measured[HEAD]]
    assert missing == pytest.approx([1 + i / rate for i in range(1, (rate + 1) // 2)] + [3.0])


def test_all_trackers_hidden_still_gives_every_frame(tmp_path):
    path = tmp_path / "t.csv"
    tracks(path, [i / 60 for i in range(601)], lambda t: 2.0 < t < 8.0)
    frames = load_frames(path, 60)
    assert len(frames) == 601
    assert sum(not f.measured.any() for f in frames) == 359


def test_a_take_gives_the_same_frames_every_time(tmp_path):
    path = tmp_path / "a.mcap"
    motion = waving(2, 2.0)
    record_simulated(path, motion, {"1": "head", "2": "left_wrist"})
    frames, again = load_frames(path, 60), load_frames(path, 60)
    assert len(frames) == 121
    for frame, other in zip(frames, again, strict=True):
        assert frame.time_s == other.time_s
        np.testing.assert_array_equal(frame.positions, other.positions)
    assert frames[0].time_s == 0.0
    positions = np.array([f.positions for f in frames])
    np.testing.assert_allclose(positions[:, HEAD], motion.positions[:, 0], atol=1e-4)
    np.testing.assert_allclose(positions[:, ROLES.index("left_wrist")], motion.positions[:, 1], atol=1e-4)
    turned = np.array([f.orientations[HEAD] for f in frames])
    np.testing.assert_allclose(turned, motion.orientations[:, 0], atol=1e-3)


def test_a_cut_take_warns_and_a_take_without_roles_is_refused(tmp_path):
    path, warnings = tmp_path / "a.mcap", []
    record_simulated(path, waving(1, 1.0), {"1": "root"})
    path.write_bytes(path.read_bytes()[:-1000])
    assert len(load_frames(path, 60, warnings.append)) > 10
    assert "cut off" in warnings[0]
    record_simulated(tmp_path / "b.mcap", waving(1, 0.2), {"7": "root"})
    with pytest.raises(FileError, match="suit: 7 assigned"):
        load_frames(tmp_path / "b.mcap", 60)


def test_other_files_are_refused(tmp_path):
    with pytest.raises(FileError, match=r"\.mcap.*\.csv"):
        load_frames(tmp_path / "a.txt", 60)
