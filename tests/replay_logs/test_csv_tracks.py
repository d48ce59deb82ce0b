"""Tracks files: in and out, and every way in which they can be wrong told in one line with its place."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.errors import FileError
from devices.sample import ROLES, TrackerSample
from replay_logs.csv_tracks import read_tracks_csv, write_tracks_csv

HEADER = "time_s,tracker,x_m,y_m,z_m"


def read(tmp_path, *lines: str):
    path = tmp_path / "tracks.csv"
    path.write_text("\n".join(lines) + "\n")
    return read_tracks_csv(path)


def test_a_plain_file(tmp_path):
    first, second = read(tmp_path, HEADER, "0.0,head,0.1,1.7,-0.2", "0.016667,root,0,0.9,0")
    assert first == TrackerSample("head", 0, (0.1, 1.7, -0.2))
    assert (second.tracker, second.host_time_ns) == ("root", 16_667_000)


def test_columns_stand_in_any_order_and_others_are_passed_over(tmp_path):
    (sample,) = read(tmp_path, "note,tracker,quality,z_m,y_m,x_m,time_s", "hi,head,0.5,3,2,1,4", "")
    assert sample == TrackerSample("head", 4_000_000_000, (1, 2, 3), quality=0.5)


def test_quaternions_are_made_unit_and_may_be_left_out_in_a_row(tmp_path):
    turned, plain = read(tmp_path, HEADER + ",qx,qy,qz,qw", "0,head,0,0,0,0,0,0,1.01", "0,root,0,0,0,,,,")
    assert turned.orientation == (0, 0, 0, 1)
    assert plain.orientation is None


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([""], "the file is empty"),
        ([HEADER], "no samples"),
        (["time_s,tracker,x_m,y_m"], ":1: column z_m is missing; the header must name time_s,tracker,x_m,y_m,z_m"),
        ([HEADER + ",qx"], ":1: column qy is missing"),
        ([HEADER + ",x_m"], ":1: column x_m is named twice"),
        ([HEADER, "0,head,0,0,0", "1,head,nan,0,0"], ":3: x_m is 'nan': it must be a finite number"),
        ([HEADER, "0,head,0,,0"], ":2: y_m is '': it must be a finite number"),
        ([HEADER, "0,head,0,inf,0"], ":2: y_m is 'inf'"),
        ([HEADER, "0,head,0,0"], ":2: the row has 4 cells, the header names 5"),
        ([HEADER, "1,head,0,0,0", "0.5,root,0,0,0"], ":3: time goes backwards"),
        ([HEADER, "1,head,0,0,0", "1,head,0,0,0"], ":3: a second sample of head at the same time"),
        ([HEADER, "0,hand,0,0,0"], ":2: unknown tracker role 'hand': use root, head, left_wrist"),
        ([HEADER + ",qx,qy,qz,qw", "0,head,0,0,0,1,1,1,1"], ":2: qx,qy,qz,qw is not a unit quaternion"),
    ],
)
def test_what_is_wrong_is_told_in_one_line_with_its_place(tmp_path, lines, message):
    with pytest.raises(FileError) as caught:
        read(tmp_path, *lines)
    assert message in str(caught.value)
    assert "tracks.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_text_and_what_is_not_there(tmp_path):
    (tmp_path / "picture.csv").write_bytes(bytes(range(256)))
    with pytest.raises(FileError, match="not a text file"):
        read_tracks_csv(tmp_path / "picture.csv")
    with pytest.raises(FileError, match="no such file"):
        read_tracks_csv(tmp_path / "none.csv")


number = st.integers(-9_000_000, 9_000_000).map(lambda n: n / 1e6)
sample = st.builds(
    TrackerSample,
    tracker=st.sampled_from(ROLES),
    host_time_ns=st.integers(0, 10**7).map(lambda n: n * 1000),
    position=st.tuples(number, number, number),
    quality=st.one_of(st.none(), st.integers(0, 100).map(lambda n: n / 100)),
)


@given(st.lists(sample, min_size=1, unique_by=lambda s: (s.tracker, s.host_time_ns)))
def test_what_is_written_reads_back(tmp_path_factory, samples):
    path = tmp_path_factory.mktemp("tracks") / "t.csv"
    write_tracks_csv(path, samples)
    assert read_tracks_csv(path) == sorted(samples, key=lambda s: s.host_time_ns)
    assert [p.name for p in path.parent.iterdir()] == ["t.csv"]


def test_lost_samples_are_missing_rows_and_time_counts_from_the_start(tmp_path):
    path = tmp_path / "t.csv"
    samples = [TrackerSample("head", 1_500_000_000, (0, 1, 0), (0, 0, 0, 1)), TrackerSample("root", 1_600_000_000)]
    write_tracks_csv(path, samples, start_ns=1_000_000_000)
    (only,) = read_tracks_csv(path)
    assert (only.host_time_ns, only.orientation) == (500_000_000, (0, 0, 0, 1))
