"""What the command tests share: some clips of our own, a small database of them, and tracks of one."""

from pathlib import Path

import numpy as np
import pytest

from capture.cli import main
from capture.demo_take import trackers_on
from devices.sample import ROLES, TrackerSample
from reconstruction.motion_files import write_bvh
from reconstruction.motion_library import actions
from reconstruction.motion_library.actions import play
from replay_logs.csv_tracks import write_tracks_csv

SECONDS = 2.0


@pytest.fixture(scope="session")
def clips(tmp_path_factory):
    """A folder of three short walks and a run on the standard body, BVH."""
    folder = tmp_path_factory.mktemp("clips")
    for name, action in (("walk_1", "walk"), ("walk_2", "walk"), ("walk_3", "walk"), ("run_1", "run")):
        rng = np.random.default_rng([1, int(name[-1])])
        write_bvh(play(getattr(actions, action)(rng), 1.75, rng, name), folder / f"{name}.bvh")
    return folder


@pytest.fixture(scope="session")
def database(clips, tmp_path_factory):
    """A database of these clips."""
    folder = tmp_path_factory.mktemp("databases") / "small"
    assert main(["database", "build", str(clips), "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="session")
def tracks(tmp_path_factory):
    """Two seconds of a walk that is not in the database, as six trackers saw it, CSV."""
    rng = np.random.default_rng(77)
    seen = trackers_on(play(actions.walk(rng), 1.75, rng, "unseen"))
    path = tmp_path_factory.mktemp("tracks") / "walk.csv"
    write_tracks_csv(path, list(_samples(seen)))
    return path


def _samples(seen):
    for row, positions in enumerate(seen.positions[: int(SECONDS * seen.fps)]):
        for role, position in zip(ROLES, positions, strict=True):
            yield TrackerSample(role, round(row / seen.fps * 1e9), tuple(position.tolist()))


@pytest.fixture
def run(capsys):
    """Runs a command: (exit status, standard output, standard error)."""

    def command(*arguments: object) -> tuple[int, str, str]:
        status = main([str(a) for a in arguments])
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return command


def entries(folder: Path) -> set[str]:
    """Everything in a folder, hidden files too."""
    return {path.name for path in folder.iterdir()}
