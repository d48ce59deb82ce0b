"""The window over a running session: what it shows, and that closing it ends the session with its take whole."""

import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from capture.live_window import SessionSource, session_actions
from capture.pipeline import Pipeline
from capture.scene import Banner
from capture.take_desk import TakeDesk
from capture.tuning import Tuning
from capture.viewing import Controls, Layers
from devices.frame import TrackerFrame
from devices.reconnecting import DeviceState
from devices.sample import ROLES
from devices.simulators.pty_simulator import simulate_device
from reconstruction.database import open_database
from reconstruction.solver import Reconstructor
from replay_logs.take import read_take
from tests.capture.test_commands import simulated_walk

ROOT = Path(__file__).parents[2]

SCRIPT = """
import sys
import capture.viewer
from capture.cli import main

show = capture.viewer.show

class Watching:
    duration_s = None

    def __init__(self, source, actions):
        self.source, self.actions, self.frame_s, self.pictures = source, actions, source.frame_s, 0

    def scene(self, time_s, layers):
        self.pictures += 1
        if self.pictures in (3, 5):
            self.actions["R"].do()  # ends the take of the command line, and begins another
        if self.pictures == 9:
            self.actions["M"].do()
        return self.source.scene(time_s, layers)

def watched(source, *, actions, **rest):
    show(Watching(source, actions), actions=actions, pictures=20, **rest)

capture.viewer.show = watched
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(not shutil.which("xvfb-run"), reason="xvfb-run is not installed (Debian package xvfb)")
def test_closing_the_window_ends_the_session_with_every_take_whole(database, tmp_path):
    config = tmp_path / "session.toml"
    config.write_text(
        f'[database]\npath = "{database}"\n[character]\nresolution = "low"\n[record]\nfolder = "{tmp_path / "takes"}"\n'
    )
    first = tmp_path / "first.mcap"
    with simulate_device(simulated_walk(), "generic", roles=ROLES, loop=True) as device:
        command = ["xvfb-run", "-a", "-s", "-screen 0 800x600x24", sys.executable, "-c", SCRIPT]
        command += ["live", str(config), "--port", device.path, "--record", str(first), "--seconds", "60"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "lost" not in done.stderr
    (second,) = (tmp_path / "takes").iterdir()
    takes = [read_take(path) for path in (first, second)]
    for take in takes:
        assert take.missing is None
        assert take.readings()
    assert [[mark.text for mark in take.marks] for take in takes] == [[], ["mark 1"]]


@pytest.fixture(scope="module")
def pipeline(database):
    return Pipeline(Reconstructor(open_database(database)))


def session_over(pipeline, shots=()):
    """What of a session the window looks at."""
    driver = SimpleNamespace(name="suit", state=DeviceState.SILENT)
    return SimpleNamespace(
        latest=shots[-1] if shots else None,
        devices=[SimpleNamespace(driver=driver)],
        assembler=SimpleNamespace(rate_hz=60.0),
        latencies=SimpleNamespace(summary=lambda: {"solve": {"p50": 1.0, "p95": 2.0, "p99": 3.0, "max": 9.0}}),
        solved=len(shots),
        skipped=2,
        recorder=None,
        tuning=Tuning(),
    )


@pytest.fixture(scope="module")
def shots(pipeline):
    tracks = simulated_walk().positions
    frames = [TrackerFrame.from_positions(n / 60, dict(zip(ROLES, tracks[n], strict=True))) for n in range(8)]
    frames += [TrackerFrame.from_positions(n / 60, dict(zip(ROLES[:5], tracks[n], strict=False))) for n in range(8, 12)]
    return [pipeline.step(frame) for frame in frames]


def test_before_the_first_pose_it_waits_and_says_how_the_devices_are(pipeline):
    scene = SessionSource(session_over(pipeline), pipeline).scene(0.0, Layers())
    assert scene.title == "waiting for trackers"
    assert scene.badges[0].text == "suit: silent"


def test_it_shows_latencies_rates_dropouts_and_who_is_missing(pipeline, shots):
    source = SessionSource(session_over(pipeline, shots), pipeline)
    scene = source.scene(0.0, Layers(ghosts=True))
    rows = {row.split("\t")[0]: row.split("\t")[1:] for row in scene.figures}
    assert rows["solve"] == ["1.0", "2.0", "3.0"]
    assert rows["frames skipped"] == ["2"]
    assert rows["right ankle"][:2] == ["prior", "1"]
    assert rows["head"][:2] == ["measured", "0"]
    assert [badge.text for badge in scene.legend] == ["measured", "extrapolated", "prior", "held", "lost"]
    assert np.isfinite(scene.spheres[-1].centres).all(), "the missing one stands where the pose has it"
    assert len(scene.lines) == 2, "skeleton and ghosts"
    assert source.scene(0.0, Layers(statistics=False, trackers=False)).figures == ()


def test_the_guides_banner_takes_the_place_of_the_figures(pipeline, shots):
    guide = SimpleNamespace(banner=lambda: Banner("hold the T-pose", count="3"), finished=False, actions=dict)
    source = SessionSource(session_over(pipeline, shots), pipeline, guide=guide)
    scene = source.scene(0.0, Layers())
    assert scene.banner.text == "hold the T-pose"
    assert scene.figures == ()
    guide.finished = True
    assert source.scene(0.0, Layers()).banner is None


def test_every_key_of_a_session_is_in_its_help(pipeline, shots, tmp_path):
    session = session_over(pipeline, shots)
    desk = TakeDesk(session, lambda path: None, tmp_path)
    actions = session_actions(SessionSource(session, pipeline, desk), pipeline)
    keys = {line.split("\t")[0] for line in Controls(actions=actions).help()}
    assert {"R", "M", "H", "9", "B"} <= keys
