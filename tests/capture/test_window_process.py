import numpy as np
import pytest

from capture.scene import Lines, Scene, Surface
from capture.viewer import show
from capture.window_process import SceneReceiver, SceneSender
from devices.errors import SixpointError


def scene(triangles: np.ndarray, shift: float) -> Scene:
    vertices = np.arange(3000.0).reshape(1000, 3) + shift
    lines = Lines(vertices, np.array([[0, 1]]))
    return Scene(surfaces=(Surface(vertices, triangles),), lines=(lines,), title=f"moved {shift}")


def test_scenes_come_through_and_triangles_go_over_once():
    triangles = np.arange(30_000, dtype=np.int32).reshape(-1, 3) % 1000
    sender, receiver = SceneSender(), SceneReceiver()
    sizes = []
    for shift in (0.0, 1.0, 2.0):
        given = scene(triangles, shift)
        message = sender.packed(given)
        sizes.append(len(message))
        back = receiver.unpacked(message)
        assert back.title == given.title
        assert np.array_equal(back.surfaces[0].vertices, given.surfaces[0].vertices)
        assert np.array_equal(back.surfaces[0].triangles, triangles)
        assert np.array_equal(back.lines[0].segments, given.lines[0].segments)
    assert sizes[1] < sizes[0] - triangles.nbytes / 2
    assert sizes[2] == sizes[1]


def test_many_meshes_in_turn_are_never_mixed_up_nor_all_kept():
    sender, receiver = SceneSender(), SceneReceiver()
    for number in range(200):
        triangles = np.full((1000, 3), number, np.int32)
        back = receiver.unpacked(sender.packed(scene(triangles, 0.0)))
        assert (back.surfaces[0].triangles == number).all()
    assert len(sender._shared) < 100
    assert len(receiver._shared) < 100


def test_without_a_display_nothing_is_started(monkeypatch):
    class Live:
        duration_s, frame_s = None, 1 / 60

        def scene(self, time_s, layers):
            raise AssertionError("never asked")

    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(SixpointError, match="no display"):
        show(Live())
