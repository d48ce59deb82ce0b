"""A solved take as the window plays it, alone and beside another solution; pictures are drawn without a window."""

from dataclasses import replace

import numpy as np
import pytest

from capture.characters import cast
from capture.commands.replay import replay
from capture.comparing import compared
from capture.playing import PerformanceSource
from capture.raster import render
from capture.scenario import marks_of, played, said
from capture.side_by_side import SideBySideSource
from capture.solve_settings import apply_settings
from capture.standings import Standing
from capture.viewer import controlled
from capture.viewing import Controls, Layers, Playback
from devices.errors import SettingError
from tests.fakes import wait_until


@pytest.fixture(scope="module")
def settings(tracks, database):
    return said(tracks, database__path=str(database))


@pytest.fixture(scope="module")
def shown(tracks, settings):
    return played(tracks, settings)


@pytest.fixture(scope="module")
def source(shown):
    return source_of(shown)


def source_of(shown):
    skeleton = shown.performance.motion.skeleton
    return PerformanceSource(shown.performance, cast("mannequin", skeleton, "low", shown.reference), title="walk")


def test_every_layer_adds_something_to_the_picture(source):
    bare = source.scene(0.5, Layers(trackers=False, statistics=False))
    for layer in ("skeleton", "lattice", "curves", "ghosts"):
        more = source.scene(0.5, Layers(trackers=False, statistics=False, **{layer: True}))
        assert len(more.lines) > len(bare.lines), layer
        assert np.isfinite(more.lines[-1].points).all()
    plain, doubtful = (source.scene(0.5, Layers(uncertainty=on)).surfaces[0].colours for on in (False, True))
    assert not np.array_equal(plain, doubtful)
    assert len(source.scene(0.5, Layers()).spheres) == 1
    assert controlled(bare, Controls(layers=Layers(floor=False))).floor is None


def test_ghosts_stand_where_the_performer_does(source):
    scene = source.scene(1.0, Layers(ghosts=True))
    ghosts = scene.lines[-1].points
    hips = source._joints[source.frame_at(1.0)][0, :3, 3]
    joints = len(source.performance.motion.skeleton)
    assert np.linalg.norm(ghosts[::joints] - hips, axis=1).max() < 0.4


def test_figures_name_stages_coverage_and_each_tracker(source):
    source._figures._due_s = -np.inf
    rows = source.scene(0.5, Layers()).figures
    assert rows[0] == "milliseconds\tp50\tp95\tp99"
    named = {row.split("\t")[0] for row in rows}
    assert {"solve", "skin", "coverage", "pictures a second", "head", "left ankle"} <= named
    assert source.scene(0.5, Layers(statistics=False)).figures == ()


def test_trackers_that_are_lost_are_counted_and_stand_where_the_pose_has_them(tracks, settings, shown):
    shown = played(tracks, apply_settings(settings, ["trackers=root,head,left_wrist,right_wrist,left_ankle"]))
    performance = shown.performance
    assert performance.standings[-1].now[5] == Standing.ABSENT
    scene = source_of(shown).scene(1.0, Layers())
    assert len(scene.spheres[0].centres) == 6
    assert np.isnan(scene.spheres[0].centres[5]).all()
    assert "right ankle" not in {row.split("\t")[0] for row in scene.figures}


def test_a_setting_changes_the_flesh_though_the_recording_stands_still(source):
    source.scene(0.5, Layers())
    before = source.scene(0.5, Layers()).surfaces[0].vertices.copy()
    source.tuning.ask("character.gravity_m_s2", 20.0)
    wait_until(lambda: np.abs(source.scene(0.5, Layers()).surfaces[0].vertices - before).max() > 1e-4)
    source.tuning.ask("character.gravity_m_s2", 0.0)
    source.scene(0.5, Layers())


def test_a_poke_moves_the_flesh_and_not_the_bones(source):
    still = source.scene(0.8, Layers()).surfaces[0].vertices.copy()
    joints = source._joints[source.frame_at(0.8)].copy()
    controls = Controls(actions=source.actions())
    assert controls.press("P")
    wait_until(lambda: np.abs(source.scene(0.8, Layers()).surfaces[0].vertices - still).max() > 1e-4)
    assert np.array_equal(joints, source._joints[source.frame_at(0.8)])


def test_two_solutions_stand_side_by_side_in_step(tracks, settings, shown, source):
    paper = played(tracks, apply_settings(settings, ["solver.method=paper"]))
    comparison = compared("walk", shown.solved, paper.solved)
    both = SideBySideSource(source, source_of(paper), comparison, ("as recorded", "solver.method=paper"))
    scene = both.scene(1.0, Layers())
    assert len(scene.surfaces) == 2
    left, right = (surface.vertices.mean(axis=0) @ scene.camera.axes[0] for surface in scene.surfaces)
    assert 1.0 < right - left < 1.6
    assert [badge.text for badge in scene.badges] == ["left: as recorded", "right: solver.method=paper"]
    rows = {row.split("\t")[0]: row.split("\t")[1:] for row in scene.figures}
    assert float(rows["joint angles, degrees"][1]) == pytest.approx(comparison.degrees.mean(), abs=0.06)
    assert len(rows["coverage now"]) == 2
    both.panel.is_open = True
    name = next(iter(both.tuning.settings))
    both.tuning.step(name, 1)
    both.scene(1.0, Layers())
    assert both.left.tuning.value(name) == both.right.tuning.value(name) == both.tuning.value(name)


def test_the_picture_of_a_replay_has_all_its_words(source):
    controls = Controls(Playback(source.duration_s, source.frame_s), actions=source.actions())
    controls.press("Tab")
    scene = controlled(source.scene(0.5, controls.layers), controls)
    with_words = render(scene, 480, 270)
    bare = replace(source.scene(0.5, Layers(statistics=False)), panel=None)
    bare = controlled(bare, Controls(Playback(source.duration_s)))
    changed = (with_words != render(bare, 480, 270)).any(axis=2)
    assert changed[:150, 300:].mean() > 0.3, "the figures"
    assert changed[60:200, :150].mean() > 0.3, "the settings"
    controls.press("H")
    help_ = controlled(source.scene(0.5, controls.layers), controls)
    assert help_.figures == ()
    assert help_.panel is None
    assert len(help_.keys) > 25
    controls.press("H")
    controls.press("Tab")


def test_tracks_have_no_marks(tracks):
    assert marks_of(tracks, 60.0) == ()


@pytest.mark.parametrize(
    ("changes", "compare", "message"),
    [([], True, "--compare needs --with"), (["solver.speed=3"], False, "unknown setting"), (["x"], False, "key=value")],
)
def test_wrong_changes_are_told_before_anything_is_opened(tracks, changes, compare, message):
    with pytest.raises(SettingError, match=message):
        replay(tracks, changes=changes, compare=compare)


def test_a_motion_is_not_solved_in_two_ways(clips):
    with pytest.raises(SettingError, match="not solved"):
        replay(clips / "run_1.bvh", changes=["solver.method=paper"], compare=True)


def test_a_replay_wears_what_the_settings_say(tracks, shown, monkeypatch):
    from capture import viewer

    opened = []
    monkeypatch.setattr(viewer, "has_display", lambda: True)
    monkeypatch.setattr(viewer, "show", lambda source, **rest: opened.append((source, rest)))
    monkeypatch.setattr("capture.scenario.played", lambda path, settings: shown)
    replay(tracks, resolution="low", changes=["character.delta=0.9", "character.volume=false"])
    (source, rest) = opened.pop()
    assert source.tuning.value("character.delta") == 0.9
    assert source.tuning.value("character.volume") is False
    assert {"P", "Tab"} <= rest["actions"].keys()
    replay(tracks, resolution="low", changes=["character.delta=0.9"], compare=True)
    (both, _) = opened.pop()
    assert both.left.tuning.value("character.delta") == 0.6
    assert both.right.tuning.value("character.delta") == 0.9
