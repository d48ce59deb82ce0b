"""Bad input gets one clear line and exit status 2, and leaves nothing half-written."""

from importlib.metadata import version

import numpy as np
import pytest

from tests.capture.conftest import entries


def one_line(err):
    """The error as the user sees it; progress bars are gone from pipes but for blank lines."""
    lines = [line for line in err.splitlines() if line.startswith("sixpoint: ")]
    assert len(lines) == 1
    assert "Traceback" not in err
    return lines[0]


HEAD = "time_s,tracker,x_m,y_m,z_m\n"
BAD_TRACKS = {
    "empty": ("", "empty"),
    "column": ("time_s,tracker,x_m,y_m\n0,root,0,1\n", "column z_m is missing"),
    "nan": (HEAD + "0,root,0,1,0\n0.1,root,nan,1,0\n", ":3: x_m is 'nan'"),
    "backwards": (HEAD + "0.2,root,0,1,0\n0.1,root,0,1,0\n", ":3: time goes backwards"),
    "role": (HEAD + "0,left_hand,0,1,0\n", ":2: unknown tracker role 'left_hand': use root, head"),
    "nothing": (HEAD, "no samples"),
}


@pytest.mark.parametrize("name", BAD_TRACKS)
def test_broken_tracks(run, database, tmp_path, name):
    text, message = BAD_TRACKS[name]
    (tmp_path / "tracks.csv").write_text(text)
    status, _, err = run("reconstruct", tmp_path / "tracks.csv", "--database", database, "--out", tmp_path / "p.bvh")
    assert status == 2
    assert message in one_line(err)
    assert entries(tmp_path) == {"tracks.csv"}


def test_a_missing_take(run, database, tmp_path):
    status, _, err = run("reconstruct", tmp_path / "no.mcap", "--database", database, "--out", tmp_path / "p.bvh")
    assert status == 2
    assert "no.mcap: no such file" in one_line(err)


def test_a_database_of_an_empty_folder(run, tmp_path):
    (tmp_path / "empty").mkdir()
    status, _, err = run("database", "build", tmp_path / "empty", "--out", tmp_path / "db")
    assert status == 2
    assert "empty" in one_line(err)
    assert entries(tmp_path) == {"empty"}


@pytest.mark.parametrize("share", [0.1, 0.5, 0.999])
def test_a_motion_cut_off_in_mid_line(run, clips, tmp_path, share):
    whole = (clips / "walk_1.bvh").read_text()
    (tmp_path / "cut.bvh").write_text(whole[: int(len(whole) * share)])
    status, _, err = run("database", "build", tmp_path / "cut.bvh", "--out", tmp_path / "db")
    assert status == 2
    assert "cut.bvh" in one_line(err)
    assert entries(tmp_path) == {"cut.bvh"}


def test_a_folder_that_is_no_database(run, tracks, tmp_path):
    status, _, err = run("reconstruct", tracks, "--database", tmp_path, "--out", tmp_path / "p.bvh")
    assert status == 2
    assert str(tmp_path) in one_line(err)
    assert entries(tmp_path) == set()


def test_a_take_truncated_anywhere(run, database, tmp_path):
    from capture.demo_take import TAKE

    whole = TAKE.read_bytes()
    rng = np.random.default_rng(5)
    for size in [0, 1, 7, 8, 9, *rng.integers(10, 60_000, 3).tolist()]:
        take = tmp_path / f"cut_{size}.mcap"
        take.write_bytes(whole[:size])
        status, _, err = run("reconstruct", take, "--database", database, "--out", tmp_path / "p.bvh")
        assert status in (0, 2)
        assert "Traceback" not in err
        if status == 2:
            assert take.name in one_line(err)
            assert "p.bvh" not in entries(tmp_path)
        else:
            assert "cut off" in err
            (tmp_path / "p.bvh").unlink()


def test_a_port_that_does_not_exist(run, tmp_path):
    status, _, err = run("record", "--port", "/dev/no_such_port", "--out", tmp_path / "t.mcap", "--seconds", 1)
    assert status == 2
    assert "/dev/no_such_port" in one_line(err)
    assert entries(tmp_path) == set()


def test_an_unknown_ending_is_refused_before_any_work(run, tracks, tmp_path):
    status, _, err = run("reconstruct", tracks, "--out", tmp_path / "pose.fbx")
    assert status == 2
    assert ".bvh" in one_line(err)


def test_an_unknown_command_suggests_one(run):
    status, _, err = run("reconstuct")
    assert status == 2
    assert "reconstruct" in one_line(err)


def test_an_existing_take_is_not_overwritten(run, tmp_path):
    (tmp_path / "t.mcap").write_bytes(b"precious")
    status, _, err = run("record", "--out", tmp_path / "t.mcap", "--port", "/dev/no_such_port", "--seconds", 1)
    assert status == 2
    assert "t.mcap" in one_line(err)
    assert (tmp_path / "t.mcap").read_bytes() == b"precious"


def test_a_device_nobody_knows(run, tmp_path):
    status, _, err = run("record", "--device", "kinect", "--port", "x", "--out", tmp_path / "t.mcap")
    assert status == 2
    assert "fastrak" in one_line(err)


def test_a_rate_that_the_database_does_not_have(run, database, tmp_path):
    (tmp_path / "session.toml").write_text(f'[database]\npath = "{database}"\n[solver]\nrate_hz = 90\n')
    status, _, err = run("live", tmp_path / "session.toml", "--no-window", "--seconds", 1)
    assert status == 2
    assert "rate_hz is 90" in one_line(err)


def test_a_command_that_there_is_not(run):
    for words, there in ((("reconstrct",), "sixpoint --help"), (("take", "inof"), "sixpoint take --help")):
        status, _, err = run(*words)
        assert status == 2
        assert f"`{there}` lists them" in one_line(err)


def test_no_command_at_all_gets_the_help(run):
    status, out, err = run()
    assert (status, err) == (2, "")
    assert "reconstruct" in out


def test_ctrl_c_is_told(run, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("replay_logs.take.read_take", interrupted)
    status, _, err = run("take", "info", "any.mcap")
    assert status == 130
    assert one_line(err) == "sixpoint: interrupted"


def test_the_version_is_told(run):
    assert run("--version") == (0, f"sixpoint {version('sixpoint')}\n", "")
