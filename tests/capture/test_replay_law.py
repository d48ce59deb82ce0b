"""The same bytes give the same poses to the last bit: again, by a used solver, played as a device, elsewhere."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from capture.export import read_npz
from devices.sample import ROLES
from reconstruction.database import open_database
from reconstruction.solver import Reconstructor
from replay_logs.frames import load_frames
from replay_logs.golden_takes import FOLDER
from replay_logs.player import players
from replay_logs.recorder import TakeRecorder
from replay_logs.rewriting import write_take
from replay_logs.take import read_take
from replay_logs.trimming import trimmed

ROOT = Path(__file__).parents[2]
SECONDS = 0.5
"""Of each take, across the moment at which a tracker goes missing."""
FROM_S = 1.3

every_golden_take = pytest.mark.parametrize("path", sorted(FOLDER.glob("*.mcap")), ids=lambda path: path.stem)


@pytest.fixture(scope="module")
def known(database):
    return open_database(database)


@pytest.fixture(scope="module")
def used(known) -> Reconstructor:
    """A solver that has solved something else before, and goes from take to take."""
    solver = Reconstructor(known)
    solver.solve_take(load_frames(FOLDER / "fastrak.mcap", known.fps)[:20])
    return solver


@every_golden_take
def test_a_golden_take_is_solved_and_replayed_bit_for_bit(path, known, used, tmp_path):
    write_take(trimmed(read_take(path), FROM_S, FROM_S + SECONDS).take, tmp_path / "part.mcap")
    played = tmp_path / "played.mcap"
    take = read_take(tmp_path / "part.mcap")
    with TakeRecorder(played, take.metadata) as recorder:
        for player, device in zip(players(take, speed=None), take.devices, strict=True):
            recorder.add_device(device)
            while not player.finished:
                recorder.write(player.name, player.read(0.1))
    frames, again = load_frames(tmp_path / "part.mcap", known.fps), load_frames(played, known.fps)
    assert len(frames) == pytest.approx(SECONDS * known.fps + 1, abs=1)
    first, second = Reconstructor(known).solve_take(frames), used.solve_take(again)
    for one, other in (
        (first.motion.rotations, second.motion.rotations),
        (first.motion.root_positions, second.motion.root_positions),
        (first.sigma, second.sigma),
        (first.coverage, second.coverage),
        (first.states, second.states),
    ):
        assert np.array_equal(one, other)
    assert len({frame.measured.sum() for frame in frames}) >= (1 if path.stem == "demo" else 2)


def test_another_process_gives_the_same_bits(run, database, tmp_path):
    for name in ("fastrak", "demo"):
        write_take(trimmed(read_take(FOLDER / f"{name}.mcap"), FROM_S, FROM_S + 1.0).take, tmp_path / f"{name}.mcap")
        here, there = tmp_path / f"{name}_here.npz", tmp_path / f"{name}_there.npz"
        words = [str(tmp_path / f"{name}.mcap"), "--database", str(database)]
        assert run("reconstruct", *words, "--out", here)[0] == 0
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "3")
        environment = os.environ | {"PYTHONPATH": str(ROOT)} | threads
        command = [sys.executable, "-m", "capture.cli", "reconstruct", *words, "--out", str(there)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        one, other = read_npz(here), read_npz(there)
        assert np.array_equal(one.rotations, other.rotations)
        assert np.array_equal(one.root_positions, other.root_positions)


def test_the_golden_takes_cover_every_role():
    roles = {role for path in FOLDER.glob("*.mcap") for d in read_take(path).devices for role in d.assignment.values()}
    assert roles == set(ROLES)
