"""`sixpoint take`: what is told of takes, and what is made of them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from capture.take_picture import timeline_text
from replay_logs.converting import csv_to_take
from replay_logs.golden_takes import FOLDER, HIDDEN_S, SECONDS
from replay_logs.rewriting import write_take
from replay_logs.summary import summarised
from replay_logs.take import Mark, SettingsChange, read_take
from tests.capture.conftest import entries

FASTRAK = FOLDER / "fastrak.mcap"


def test_info_tells_devices_roles_and_dropouts(run):
    status, out, _ = run("take", "info", FASTRAK, "--json")
    told = json.loads(out)
    assert status == 0
    assert told["duration_s"] == pytest.approx(SECONDS, abs=0.05)
    (device,) = told["devices"]
    assert (device["protocol"], device["opened"]) == ("fastrak", 1)
    assert device["lost_bytes"] > 0
    assert [health["rate_hz"] for health in device["health"]] == pytest.approx([30.0, 27.0, 30.0, 30.0], abs=0.1)
    roles = {role["role"]: role for role in told["roles"]}
    assert roles["root"]["seen"] == 0.0
    assert roles["left_wrist"]["dropouts"] == []
    assert np.allclose(roles["right_wrist"]["dropouts"], [HIDDEN_S], atol=0.05)
    assert roles["right_wrist"]["seen"] == pytest.approx(1 - (HIDDEN_S[1] - HIDDEN_S[0]) / SECONDS, abs=0.02)


def test_info_is_read_by_people_too(run, tmp_path):
    take = read_take(FASTRAK)
    start_ns = take.readings()[0].host_time_ns
    noted = replace(
        take,
        marks=(Mark(start_ns + 500_000_000, "the jump"),),
        changes=(SettingsChange(start_ns + 700_000_000, {"device.fastrak.beta": 7.0}, {"fastrak": 20}),),
        metadata={**take.metadata, "session": '[performer]\nheight_m = 1.81\n[solver]\nmethod = "default"\n'},
    )
    write_take(noted, tmp_path / "noted.mcap")
    status, out, _ = run("take", "info", tmp_path / "noted.mcap")
    assert status == 0
    for words in ("fastrak", "left_wrist", "never", "0.50 s  the jump", "device.fastrak.beta = 7.0", "height_m = 1.81"):
        assert words in out
    assert "method" not in out


def test_the_picture_is_green_where_a_tracker_was_seen_and_red_where_not(run, tmp_path):
    picture = tmp_path / "take.png"
    assert run("take", "info", FASTRAK, "--picture", picture)[0] == 0
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    red = (pixels[..., 0] > 180) & (pixels[..., 1] < 110)
    green = (pixels[..., 1] > 120) & (pixels[..., 0] < 90)
    rows = np.flatnonzero(red.any(axis=1) | green.any(axis=1))
    strips = np.split(rows, np.flatnonzero(np.diff(rows) > 3) + 1)
    assert len(strips) == 6
    share = [red[strip].sum() / (red | green)[strip].sum() for strip in strips]
    assert share == pytest.approx([1, 1, 0, 0.1, 0, 0], abs=0.03)
    assert entries(tmp_path) == {"take.png"}


def test_a_timeline_is_lower_where_something_is_missing():
    role = summarised(read_take(FASTRAK)).roles[3]
    text = timeline_text(role.timeline(3.0, 10))
    assert text[:4] == "████"
    assert text[5] == " "
    assert role.timeline(3.0, 1)[0] == pytest.approx(role.seen, abs=0.01)


def test_a_trimmed_take_is_solved_to_the_same_poses_from_its_start_on(run, tmp_path, database, tracks):
    take, part = tmp_path / "a.mcap", tmp_path / "part.mcap"
    csv_to_take(tracks, take)
    assert run("take", "trim", take, part, "--to", 1.0)[0] == 0
    for file in (take, part):
        status, _, error = run("reconstruct", file, "--database", database, "--out", file.with_suffix(".npz"))
        assert status == 0, error
    with np.load(take.with_suffix(".npz")) as whole, np.load(part.with_suffix(".npz")) as first:
        assert len(first["rotations_xyzw"]) == 61
        for name in ("rotations_xyzw", "root_positions_m"):
            assert np.array_equal(whole[name][:61], first[name])


def test_coverage_is_told_with_a_database(run, tmp_path, database):
    picture = tmp_path / "take.png"
    status, out, error = run("take", "info", FASTRAK, "--database", database, "--picture", picture, "--json")
    assert status == 0, error
    assert json.loads(out)["coverage"] > 0.1
    with Image.open(picture) as drawn:
        assert drawn.height > 350


def test_takes_are_merged_and_converted(run, tmp_path):
    both, tracks, arrays, again = (tmp_path / name for name in ("both.mcap", "a.csv", "a.npz", "again.mcap"))
    status, out, _ = run("take", "merge", FASTRAK, FOLDER / "generic.mcap", both, "--offset-s", 0)
    assert (status, "0 s after" in out) == (0, True)
    assert run("take", "convert", both, tracks)[0] == 0
    assert run("take", "convert", both, arrays)[0] == 0
    assert run("take", "convert", tracks, again)[0] == 0
    assert tracks.read_text().startswith("time_s,tracker,")
    assert len(read_take(again).devices) == 1
    assert read_take(both).metadata["merged"].startswith("fastrak.mcap and generic.mcap")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("info", "none.mcap"), "no such file"),
        (("info", FASTRAK, "--picture", "x.jpg"), ".png"),
        (("trim", FASTRAK, "x.csv"), ".mcap"),
        (("trim", FASTRAK, "none/x.mcap"), "does not exist"),
        (("trim", FASTRAK, "x.mcap", "--from", 9), "from 0 to 3.00 s"),
        (("merge", FASTRAK, FASTRAK, "x.mcap", "--order", "up"), "auto, parallel, after"),
        (("convert", FASTRAK, "x.bvh"), ".csv, .npz, .mcap"),
        (("convert", "x.npz", "x.mcap"), ".csv, .mcap"),
    ],
)
def test_what_cannot_be_done_is_one_line(run, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    status, _, error = run("take", *words)
    assert status == 2
    assert message in error
    assert len(error.strip().splitlines()) == 1
    assert entries(tmp_path) == set()
