"""The commands of the main job, run as a user runs them."""

import json

import numpy as np
import pytest

from capture.cli import main
from capture.demo_take import trackers_on
from capture.export import read_npz
from devices.sample import ROLES
from devices.simulators.pty_simulator import simulate_device
from reconstruction.motion_files import read_motion
from reconstruction.motion_library import actions
from reconstruction.motion_library.actions import play
from tests.capture.conftest import SECONDS, entries


def test_a_take_becomes_poses_in_every_format(run, database, tracks, tmp_path):
    for ending in ("bvh", "npz", "csv", "glb"):
        status, out, err = run(
            "reconstruct", tracks, "--database", database, "--out", tmp_path / f"p.{ending}", "--json"
        )
        assert status == 0, err
        assert json.loads(out)["poses"] == round(SECONDS * 60)
    assert entries(tmp_path) == {"p.bvh", "p.npz", "p.csv", "p.glb"}
    written, exact = read_motion(tmp_path / "p.bvh"), read_npz(tmp_path / "p.npz")
    assert len(written) == len(exact) == round(SECONDS * 60)
    np.testing.assert_allclose(written.root_positions, exact.root_positions, atol=1e-6)


def test_solving_twice_gives_the_same_bits(run, database, tracks, tmp_path):
    for name in ("a.npz", "b.npz"):
        assert run("reconstruct", tracks, "--database", database, "--out", tmp_path / name)[0] == 0
    first, second = read_npz(tmp_path / "a.npz"), read_npz(tmp_path / "b.npz")
    np.testing.assert_array_equal(first.rotations, second.rotations)
    np.testing.assert_array_equal(first.root_positions, second.root_positions)


@pytest.mark.parametrize("roles", ["left_wrist,right_ankle", "left_wrist,right_wrist,left_ankle,right_ankle"])
def test_any_subset_of_trackers_is_solved(run, database, tracks, tmp_path, roles):
    status, out, _ = run(
        "reconstruct", tracks, "--database", database, "--out", tmp_path / "p.npz", "--trackers", roles, "--json"
    )
    assert status == 0
    assert np.isfinite(read_npz(tmp_path / "p.npz").rotations).all()
    assert json.loads(out)["poses"] == round(SECONDS * 60)


def test_the_papers_method_is_there(run, database, tracks, tmp_path):
    status, _, err = run(
        "reconstruct", tracks, "--database", database, "--out", tmp_path / "p.npz", "--method", "paper"
    )
    assert status == 0, err


def test_a_database_tells_what_is_inside(run, database):
    status, out, _ = run("database", "info", database, "--json")
    assert status == 0
    assert json.loads(out)["clips"] == 4


def simulated_walk():
    rng = np.random.default_rng(8)
    return trackers_on(play(actions.walk(rng), 1.75, rng, "live"))


def test_recording_a_device_and_solving_the_take(run, database, tmp_path):
    take = tmp_path / "take.mcap"
    with simulate_device(simulated_walk(), "generic", roles=ROLES) as device:
        status, out, err = run("record", "--port", device.path, "--out", take, "--seconds", 2, "--json")
    assert status == 0, err
    assert json.loads(out)["samples"] > 300
    status, _, err = run("reconstruct", take, "--database", database, "--out", tmp_path / "p.bvh")
    assert status == 0, err
    assert read_motion(tmp_path / "p.bvh").duration_s > 1


def test_a_live_session_without_a_window(run, database, tmp_path):
    config = tmp_path / "session.toml"
    config.write_text(f'[database]\npath = "{database}"\n[character]\nresolution = "low"\n')
    take = tmp_path / "live.mcap"
    with simulate_device(simulated_walk(), "generic", roles=ROLES) as device:
        status, out, err = run(
            "live", config, "--port", device.path,
            "--no-window", "--seconds", 4, "--record", take, "--json",
        )  # fmt: skip
    assert status == 0, err
    figures = json.loads(out)
    assert figures["poses"] > 20, err
    assert figures["milliseconds"].keys() >= {"solve", "skin", "whole frame", "moment to vertices"}
    assert take.stat().st_size > 10_000


def test_a_configuration_is_written_once_and_is_right(run, tmp_path):
    path = tmp_path / "session.toml"
    assert run("config", "init", path)[0] == 0
    assert run("config", "check", path)[0] == 0
    assert run("config", "init", path)[0] == 2


@pytest.mark.xdist_group("library")
def test_the_demo_without_a_display(run, tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    status, out, err = run("demo", "--out", tmp_path / "demo", "--resolution", "low", "--seconds", 2, "--json")
    assert status == 0, err
    assert entries(tmp_path / "demo") == {"pose.bvh", "character.glb", "latency.json", "demo.gif", "frames"}
    assert json.loads(out)["whole frame"].keys() == {"p50", "p95", "p99", "max"}
    assert len(entries(tmp_path / "demo" / "frames")) > 20
    assert read_motion(tmp_path / "demo" / "pose.bvh").duration_s == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("command", ["demo", "replay", "live", "record", "reconstruct", "deform", "simulate", "doctor"])
def test_every_command_has_help_worth_reading(capsys, command):
    assert main([command, "--help"]) == 0
    assert len(capsys.readouterr().out.splitlines()) > 12
