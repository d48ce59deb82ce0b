import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from capture.scene import Camera
from capture.viewing import SPEEDS, Action, Controls, Playback


def listed(controls):
    """The lines of the help that are keys, not headings."""
    return [line for line in controls.help() if "\t" in line]


def test_a_recording_plays_round_and_round():
    playback = Playback(duration_s=2.0)
    playback.advance(1.5)
    playback.advance(1.0)
    assert playback.time_s == pytest.approx(0.5)
    assert not playback.paused


def test_without_a_loop_it_stops_at_the_end():
    playback = Playback(duration_s=2.0, loop=False)
    playback.advance(5.0)
    assert playback.time_s == 2.0
    assert playback.paused


def test_speed_counts_only_in_a_recording():
    recorded, live = Playback(10.0, speed=0.5), Playback(None, speed=0.5)
    recorded.advance(2.0)
    live.advance(2.0)
    assert recorded.time_s == 1.0
    assert live.time_s == 2.0


def test_a_paused_recording_stands_still_and_steps_by_whole_frames():
    playback = Playback(1.0, frame_s=0.1, time_s=0.33)
    playback.step(1)
    assert playback.paused
    assert playback.time_s == pytest.approx(0.4)
    playback.advance(9.0)
    playback.step(-2)
    assert playback.time_s == pytest.approx(0.2)


@given(st.lists(st.sampled_from(["Left", "Right", ",", ".", "Home", "End", "[", "]", "Space"]), max_size=40))
def test_no_keys_lead_out_of_the_recording(keys):
    controls = Controls(Playback(3.0, frame_s=1 / 60))
    for key in keys:
        assert controls.press(key)
        controls.playback.advance(0.4)
        assert 0 <= controls.playback.time_s <= 3.0
        assert controls.playback.speed in SPEEDS


def test_an_empty_recording_does_not_divide_by_nothing():
    playback = Playback(duration_s=0.0)
    playback.advance(1.0)
    assert playback.time_s == 0.0


def test_live_has_no_seeking():
    controls = Controls(Playback(None))
    controls.playback.advance(1.0)
    for key in ("Left", "End", "]"):
        controls.press(key)
    assert controls.playback.time_s == 1.0
    assert controls.playback.speed == 1.0
    assert controls.playback.words() == "live"
    assert not any("back" in line for line in controls.help())


def test_the_clock_is_readable():
    assert Playback(83.24, time_s=3.21, speed=0.5).words() == "00:03.2 / 01:23.2  x0.5"
    assert Playback(60.0, time_s=59.97, paused=True).words() == "01:00.0 / 01:00.0  paused"


def test_layers_toggle():
    controls = Controls()
    assert controls.layers.skin
    controls.press("1")
    assert not controls.layers.skin
    controls.press("1")
    assert controls.layers.skin


def test_the_sessions_own_keys_are_done_and_listed():
    done = []
    controls = Controls(actions={"R": Action("record", lambda: done.append("record"))})
    assert controls.press("R")
    assert done == ["record"]
    assert "R\trecord" in controls.help()
    assert not controls.press("F11")


def test_every_key_in_the_help_does_something():
    controls = Controls(Playback(5.0))
    for line in listed(controls):
        for key in line.split("\t")[0].split(" "):
            assert controls.press(key)


@given(st.lists(st.sampled_from("ADWS+-"), max_size=60))
def test_the_camera_never_goes_over_the_pole_nor_sticks_to_it(keys):
    controls, given_camera = Controls(), Camera()
    for key in keys:
        controls.press(key)
        assert abs(controls.camera(given_camera).pitch) < math.pi / 2
    for _ in range(40):
        controls.press("W")
        controls.camera(given_camera)
    highest = controls.camera(given_camera).pitch
    controls.press("S")
    assert controls.camera(given_camera).pitch < highest


def test_dragging_moves_the_picture_with_the_mouse():
    controls, camera = Controls(), Camera(yaw=0.0, pitch=0.0)
    controls.move(0.5, 0.0)
    moved = controls.camera(camera)
    height_m = 2 * camera.distance * math.tan(camera.fov / 2)
    assert np.allclose(np.subtract(moved.target, camera.target), [-0.5 * height_m, 0, 0])
    controls.press("0")
    assert controls.camera(camera) == camera


def test_the_page_on_the_window_names_every_key():
    page = (Path(__file__).parents[2] / "docs" / "window.md").read_text()
    table = "\n".join(line.split("|")[1] for line in page.splitlines() if line.startswith("|"))
    for line in listed(Controls(Playback(5.0))):
        for key in line.split("\t")[0].split(" "):
            assert key in table
