"""What a take is solved with: said in the take, by options, by `--with`."""

from pathlib import Path

import numpy as np
import pytest

from capture.config import SessionConfig, commented_config
from capture.export import read_npz
from capture.live import start_recording
from capture.solve_settings import SolveSettings, allowed_keys, apply_settings, recorded_settings
from devices.driver import Reading
from devices.errors import SettingError
from devices.filters import OneEuroSettings
from reconstruction.calibration import Profile
from reconstruction.mounting import Mounting
from replay_logs.golden_takes import FOLDER
from replay_logs.retuning import retuned
from replay_logs.take import SettingsChange, Take, read_take


def take_of(session: str) -> Take:
    return Take(Path("a.mcap"), (), {}, {"session": session})


def test_only_what_a_session_said_counts():
    assert recorded_settings(take_of(commented_config())) == SolveSettings()
    said = SessionConfig.model_validate(
        {"performer": {"height_m": 1.62}, "solver": {"method": "paper"}, "output": {"streams": ["vmc://h:1"]}}
    )
    settings = recorded_settings(take_of(commented_config(said)))
    assert (settings.height_m, settings.solver.method, settings.database) == (1.62, "paper", "library")
    assert settings.session.model_dump(exclude_unset=True) == {"performer": {"height_m": 1.62}}


@pytest.mark.parametrize("session", ["", "no toml =", "[performer]\nheight_m = 99", "performer = 3", "[new]\nkey = 1"])
def test_a_session_of_another_version_is_no_hindrance(session):
    assert recorded_settings(take_of(session)) == SolveSettings()


def test_options_stand_above_the_take_and_changes_above_both():
    settings = SolveSettings().with_values(performer__height_m=1.7, solver__method=None, trackers="head,root")
    assert (settings.height_m, settings.solver.method, settings.trackers) == (1.7, "default", "head,root")
    changed = apply_settings(
        settings,
        ["performer.height_m = 1.9", "solver.neighbours.count=64", "device.my suit.smooth=true", "database.path=a b"],
    )
    assert (changed.height_m, changed.solver.neighbours.count, changed.database) == (1.9, 64, "a b")
    assert changed.device == {"my suit": {"smooth": True}}
    assert (settings.height_m, settings.device) == (1.7, {})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("solver.method", "key=value"),
        ("=3", "key=value"),
        ("solver.speed=3", "solver.method, solver.tracker_sigma_m"),
        ("light=3", r"performer\.\.\."),
        ("solver.method=magic", "default, paper"),
        ("solver.relocalise=3", "true or false"),
        ("solver.tracker_sigma_m=wide", "a number such as"),
        ("solver.tracker_sigma_m=-1", "0 or more"),
        ("solver.hold_after_s=inf", "0 or more"),
        ("solver.neighbours.count=1.5", "a whole number such as"),
        ("performer.height_m=9", "less than or equal to 2.5"),
        ("device.suit.colour=1", "device.suit.smooth"),
        ("device.beta=1", "device.NAME.smooth"),
        ("device.suit.beta=high", "a number, true or false"),
        ("output.streams=[]", r"performer\.\.\."),
    ],
)
def test_a_wrong_change_says_what_is_right(change, message):
    with pytest.raises(SettingError, match=message):
        apply_settings(SolveSettings(), [change])


def test_every_allowed_key_can_be_set_to_what_it_is():
    settings = SolveSettings()
    for key in allowed_keys(settings):
        section, *path = key.split(".")
        if section in ("device", "trackers"):
            continue
        value = settings.solver if section == "solver" else getattr(settings.session, section)
        for name in path:
            value = getattr(value, name)
        text = str(value).lower() if isinstance(value, bool) else str(value) or '""'
        assert apply_settings(settings, [f"{key}={text}"]).solver == settings.solver


def test_a_take_is_read_with_other_filters_than_it_was_recorded_with():
    take = read_take(FOLDER / "fastrak.mcap")
    changed = Take(
        take.path, take.devices, take.chunks, take.metadata,
        changes=(SettingsChange(0, {"device.fastrak.beta": 1.0, "device.fastrak.gate": True}, {"fastrak": 3}),),
    )  # fmt: skip
    smooth = {"smooth": True, "smooth_above_mm": 0.0, "min_cutoff_hz": 0.5, "beta": 0.0}
    calm = retuned(changed, {"fastrak": smooth})
    assert isinstance(calm.devices[0].smoothing, OneEuroSettings)
    assert calm.changes[0].values == {"device.fastrak.gate": True}
    wrists = [[r.position[2] for r in own.readings() if r.role == 2] for own in (take, calm)]
    ways = [np.abs(np.diff(wrist)).sum() for wrist in wrists]
    assert ways[1] < 0.8 * ways[0]
    assert retuned(take, {}) == take


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"suit": {"beta": 1.0}}, "use fastrak"),
        ({"fastrak": {"beta": 1e9}}, "from 0 to 500"),
        ({"fastrak": {"smooth": 1.0}}, "true or false"),
        ({"fastrak": {"beta": True}}, "a number"),
        ({"fastrak": {"colour": True}}, "smooth, "),
    ],
)
def test_wrong_filters_are_refused(settings, message):
    with pytest.raises(SettingError, match=message):
        retuned(read_take(FOLDER / "fastrak.mcap"), settings)


def test_a_take_holds_the_calibration_it_was_made_with(run, database, tmp_path):
    profile, kept = tmp_path / "anna.json", tmp_path / "kept.json"
    Profile({"stature": 1.06, "arms": 0.95}, Mounting.at_the_joints(), 1.0).write(profile)
    source = read_take(FOLDER / "fastrak.mcap")
    config = SessionConfig.model_validate({"performer": {"profile": str(profile)}})
    with start_recording(tmp_path / "a.mcap", config, []) as recorder:
        recorder.add_device(source.devices[0])
        recorder.write("fastrak", Reading(source.chunks["fastrak"][:40]))
    profile.rename(kept)
    words = ("--database", database, "--out")
    assert run("reconstruct", tmp_path / "a.mcap", *words, tmp_path / "a.npz")[0] == 0
    assert run("reconstruct", tmp_path / "a.mcap", *words, tmp_path / "b.npz", "--profile", kept)[0] == 0
    assert run("reconstruct", tmp_path / "a.mcap", *words, tmp_path / "c.npz", "--height-m", 1.5)[0] == 0
    own, given, short = (read_npz(tmp_path / f"{name}.npz") for name in "abc")
    assert np.array_equal(own.skeleton.offsets, given.skeleton.offsets)
    assert np.array_equal(own.rotations, given.rotations)
    assert own.skeleton.offsets[5, 1] / short.skeleton.offsets[5, 1] > 1.05
    status, _, error = run("reconstruct", tmp_path / "a.mcap", *words, tmp_path / "d.npz", "--profile", profile)
    assert status == 2
    assert "anna.json" in error
