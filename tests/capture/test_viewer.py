import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from capture import viewer
from capture.raster import placed_cards, render
from capture.scene import Badge, Camera, Lines, Panel, PanelRow, Scene, Spheres, Surface, Timeline
from devices.errors import SixpointError

SCRIPT = """
import multiprocessing
import sys
import numpy as np
from capture.raster import save_png
from capture.viewer import show, snapshot
from capture.viewing import Action, Layers
from devices.errors import SixpointError
from tests.capture.test_viewer import picture, wordy

save_png(snapshot(picture(), 320, 200), sys.argv[1])
save_png(snapshot(wordy(), 960, 540), sys.argv[2])

class Turning:
    duration_s, frame_s, asked = 1.0, 1 / 60, 0
    def scene(self, time_s, layers):
        assert layers == Layers(lattice=True)
        self.asked += 1
        return picture(with_skin=self.asked % 3 != 0)

source = Turning()
show(source, pictures=7, layers=Layers(lattice=True), actions={"R": Action("record", print)})
print("pictures", source.asked)

class Live(Turning):
    duration_s = None

ending = Live()
show(ending, until=lambda: ending.asked == 4, layers=Layers(lattice=True))
print("until", ending.asked)

class Killing(Live):
    def scene(self, time_s, layers):
        if self.asked == 2:
            multiprocessing.active_children()[0].kill()
        return super().scene(time_s, layers)

try:
    show(Killing(), layers=Layers(lattice=True))
except SixpointError as error:
    print("lost" if "the window is lost" in str(error) else error)
"""


def picture(with_skin: bool = True) -> Scene:
    corners = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]])
    ghost = Surface(corners - [0, 0, 0.5], np.array([[0, 1, 2]]), opacity=0.3)
    red = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]]), colours=(0.9, 0.1, 0.1))
    behind = Spheres(np.array([[0, 0.5, -0.3], [np.nan, 0, 0]]), 0.12, (0.1, 0.9, 0.1), through=1.0)
    hidden = Spheres(np.array([[0.3, 0.5, -0.3]]), 0.12, (0.1, 0.1, 0.9), through=0.0)
    return Scene(
        surfaces=(ghost, red) if with_skin else (),
        lines=(Lines(corners, np.array([[0, 2]]), width=4.0, through=1.0), Lines(corners, np.array([[1, 3]]))),
        spheres=(behind, hidden),
        camera=Camera(target=(0, 0.5, 0), distance=3.0, yaw=0.0, pitch=0.05),
        title="window",
        status=("status",),
    )


def wordy() -> Scene:
    """Every kind of words there is."""
    rows = (PanelRow("character.delta", "0.6", 0.6), PanelRow("character.volume", "on"))
    return replace(
        picture(),
        badges=(Badge((0.9, 0.2, 0.2), "take.mcap"),),
        figures=("milliseconds\tp50\tp99", "solve\t1.2\t3.4", "", "tracker\tnow", "head\tlost"),
        legend=(Badge((0.2, 0.7, 0.4), "measured"), Badge((0.8, 0.2, 0.2), "lost")),
        panel=Panel(rows, 1, ("what it does",)),
        timeline=Timeline(0.25, (0.5,)),
    )


@pytest.mark.parametrize("words", [wordy(), replace(wordy(), keys=("Shown", "1\tskin", "Camera", "A\tround"))])
def test_no_card_leaves_the_picture_and_framed_ones_do_not_cover_each_other(words):
    cards = placed_cards(words, 960, 540, (1.0, 1.0, 1.0))
    for placed in cards:
        rows, columns = placed.card.shape[:2]
        assert placed.left >= 0
        assert placed.top >= 0
        assert placed.left + columns <= 960
        assert placed.top + rows <= 540
    taken = np.zeros((540, 960), int)
    for placed in cards if not words.keys else ():
        rows, columns = placed.card.shape[:2]
        taken[placed.top : placed.top + rows, placed.left : placed.left + columns] += 1
    assert taken.max() <= 1


@pytest.mark.skipif(not shutil.which("xvfb-run"), reason="xvfb-run is not installed (Debian package xvfb)")
def test_the_window_shows_surfaces_marks_and_words_on_a_virtual_screen(tmp_path):
    from PIL import Image

    path, words = tmp_path / "window.png", tmp_path / "words.png"
    command = ["xvfb-run", "-a", "-s", "-screen 0 1024x640x24", sys.executable, "-c", SCRIPT, str(path), str(words)]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["pictures", "7", "until", "4", "lost"]
    seen = np.asarray(Image.open(path)).astype(int)
    assert seen.shape == (200, 320, 3)
    red = (seen[..., 0] > 100) & (seen[..., 1] < 90) & (seen[..., 2] < 90)
    green = (seen[..., 1] > seen[..., 0] + 60) & (seen[..., 1] > seen[..., 2] + 60)
    blue = (seen[..., 2] > seen[..., 0] + 60) & (seen[..., 2] > seen[..., 1] + 60)
    assert red.sum() > 4000, "the surface"
    assert green.sum() > 150, "the ball that shines through it"
    assert np.abs(np.argwhere(green).mean(axis=0) - [100, 160]).max() < 12
    assert blue.sum() == 0, "the ball that it hides"
    dark = seen.max(axis=2) < 130
    assert dark[:40, :100].any(), "the title"
    assert dark[160:, :100].any(), "the status"
    shown = np.asarray(Image.open(words)).astype(int)
    drawn = render(wordy(), 960, 540).astype(int)
    for placed in placed_cards(wordy(), 960, 540, (0.885, 0.90, 0.92)):
        rows, columns = placed.card.shape[:2]
        here = slice(placed.top, placed.top + rows), slice(placed.left, placed.left + columns)
        assert np.abs(shown[here] - placed.card).mean() < 6, "the window shows the card where it belongs"
        if placed.framed:
            assert np.abs(drawn[here] - placed.card).mean() < 12, "and so does the picture"


def test_no_display_is_told_in_one_line(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert not viewer.has_display()
    with pytest.raises(SixpointError, match="no display"):
        viewer.snapshot(Scene())


@pytest.mark.parametrize(
    ("message", "package"),
    [
        ("libusb-1.0.so.0: cannot open shared object file: No such file or directory", "libusb-1.0-0"),
        ("libGL.so.1: cannot open shared object file", "libgl1"),
        ("libEGL.so.1: cannot open shared object file", "libegl1"),
    ],
)
def test_a_missing_system_library_names_its_package(monkeypatch, message, package):
    import builtins

    real = builtins.__import__

    def failing(name, *rest, **named):
        if name == "open3d":
            raise OSError(message)
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", failing)
    monkeypatch.setenv("DISPLAY", ":77")
    with pytest.raises(SixpointError, match=f"apt-get install {package}") as told:
        viewer.snapshot(Scene())
    assert "\n" not in str(told.value)
