"""`sixpoint batch`: many takes, some of them broken, some processes killed, on this machine and on a cluster."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from capture.batch import COLUMNS, Job, Outcome, failed, kept, planned, scored, solve_job, summarised
from capture.evaluation_runs import tracker_frames
from capture.export import read_npz
from capture.workers import by_cluster, by_processes
from devices.errors import FileError, SettingError
from devices.sample import ROLES, TrackerSample
from reconstruction.motion_files import read_bvh, write_bvh
from reconstruction.motion_operations import cropped, resampled
from replay_logs.csv_tracks import write_tracks_csv
from tests.capture.perilous import perilous

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def folder(clips, tmp_path_factory) -> Path:
    """Two takes with their true motions, one in a folder of its own, and a broken one."""
    folder = tmp_path_factory.mktemp("batch")
    for name, clip in (("takes/a/walk", "walk_1"), ("takes/run", "run_1")):
        motion = resampled(read_bvh(clips / f"{clip}.bvh"), 60.0)
        motion = cropped(motion, 20, 80)
        for path in (folder / f"{name}.csv", folder / f"{name.replace('takes', 'truth')}.bvh"):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_bvh(motion, folder / f"{name.replace('takes', 'truth')}.bvh")
        samples = [
            TrackerSample(role, round(frame.time_s * 1e9), tuple(frame.positions[row]))
            for frame in tracker_frames(motion, ROLES)
            for row, role in enumerate(ROLES)
        ]
        write_tracks_csv(folder / f"{name}.csv", samples)
    (folder / "takes" / "broken.mcap").write_bytes(b"no take at all")
    return folder


def rows(out: Path) -> dict[str, dict[str, str]]:
    with (out / "results.csv").open(newline="", encoding="utf-8") as file:
        return {Path(row["take"]).name: row for row in csv.DictReader(file)}


def test_takes_are_solved_scored_and_not_solved_again(run, folder, database, tmp_path):
    out = tmp_path / "out"
    words = ("batch", folder / "takes", "--out", out, "--score", folder / "truth", "--database", database, "--json")
    status, printed, error = run(*words, "--ending", ".npz", "--jobs", 2)
    assert status == 2
    assert "1 of 3 takes" in error
    summary = json.loads(printed)
    assert (summary["solved"], summary["failed"], summary["kept"]) == (2, 1, 0)
    table = rows(out)
    assert set(table) == {"walk.csv", "run.csv", "broken.mcap"}
    assert "not a take" in table["broken.mcap"]["error"]
    for name in ("walk.csv", "run.csv"):
        assert 0 < float(table[name]["mpjpe_cm"]) < 5
        assert float(table[name]["missing_s"]) == 0
    alone = tmp_path / "alone.npz"
    assert run("reconstruct", folder / "takes" / "run.csv", "--database", database, "--out", alone)[0] == 0
    assert np.array_equal(read_npz(alone).rotations, read_npz(out / "run.npz").rotations)
    assert (out / "a" / "walk.npz").is_file()

    summary = json.loads(run(*words, "--ending", ".npz", "--jobs", 1)[1])
    assert (summary["solved"], summary["failed"], summary["kept"]) == (0, 1, 2)
    assert rows(out)["run.csv"]["mpjpe_cm"] == table["run.csv"]["mpjpe_cm"]


def test_what_is_kept_holds_for_the_same_take_and_settings_only(folder, database, tmp_path):
    out = tmp_path / "run.npz"
    job = Job(str(folder / "takes" / "run.csv"), str(out), given={"database__path": str(database)})
    assert kept(job) is None
    assert solve_job(job).status == "solved"
    before = kept(job)
    assert before is not None
    assert before.status == "kept"
    assert kept(Job(job.take, job.out, given={**job.given, "performer__height_m": 1.7})) is None
    assert kept(Job(job.take, job.out, given=job.given, changes=("solver.noise_gain=0",))) is None
    out.rename(tmp_path / "moved.npz")
    assert kept(job) is None
    out.touch()
    job.result.write_text("{}")
    assert kept(job) is None


def test_a_take_that_cannot_be_scored_is_solved_all_the_same(folder, database, tmp_path):
    job = Job(str(folder / "takes" / "run.csv"), str(tmp_path / "a.bvh"), str(ROOT / "LICENSE"), {})
    outcome = solve_job(Job(job.take, job.out, job.truth, {"database__path": str(database)}))
    assert outcome.status == "solved"
    assert "not scored" in outcome.error
    assert (tmp_path / "a.bvh").is_file()


def test_scores_are_of_what_both_have(folder):
    truth = read_bvh(folder / "truth" / "run.bvh")
    figures = scored(truth, cropped(truth, 0, 45))
    assert figures["mpjpe_cm"] == 0
    assert figures["missing_s"] == pytest.approx(15 / 60, abs=1e-3)
    with pytest.raises(SettingError, match="frames to score"):
        scored(truth, cropped(truth, 0, 5))


def test_motions_lie_where_their_takes_did(tmp_path):
    for name in ("z/a.mcap", "x/a.mcap", "x/b/a.csv", "y/c.mcap", "y/c.csv", "x/.hidden.csv", "x/note.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    out = tmp_path / "out"
    jobs = planned([tmp_path / "x", tmp_path / "y" / "c.mcap", tmp_path / "y" / "c.csv"], out)
    assert [Path(job.out).relative_to(out).as_posix() for job in jobs] == [
        "a.bvh", "b/a.bvh", "c.mcap.bvh", "c.csv.bvh",
    ]  # fmt: skip
    with pytest.raises(SettingError, match="one place"):
        planned([tmp_path / "x" / "a.mcap", tmp_path / "x" / "b" / "a.csv", tmp_path / "z"], out)
    for wrong in (tmp_path / "none", tmp_path / "out"):
        with pytest.raises(FileError):
            planned([wrong], out)


def test_the_summary_names_the_worst():
    outcomes = [
        Outcome("a", "solved", {"duration_s": 60.0, "mpjpe_cm": 1.0}),
        Outcome("b", "kept", {"duration_s": 30.0, "mpjpe_cm": 3.0}),
        failed(Job("c", "c.bvh"), "two\nlines"),
    ]
    summary = summarised(outcomes)
    assert (summary["minutes"], summary["failures"]) == (1.5, {"c": "two lines"})
    assert summary["figures"]["mpjpe_cm"] == {"mean": 2.0, "worst": 3.0, "worst_take": "b", "takes": 2}
    assert set(outcomes[0].row()) <= set(COLUMNS)


def gone(job: str, reason: str) -> str:
    """What the tests make of a lost job."""
    return f"{job.partition(':')[0]} lost: {reason}"


def test_a_killed_process_takes_no_other_job_with_it(tmp_path):
    jobs = ["fine", "always", f"once:{tmp_path}/marker", "fine", "fine"]
    results = sorted(by_processes(perilous, jobs, gone, 2))
    assert results[0].startswith("always lost: its process died twice")
    assert results[1:] == ["fine done"] * 3 + ["once done"]


def test_who_stops_asking_leaves_no_process_behind():
    results = by_processes(perilous, ["fine", "slow", "slow"], gone, 2)
    assert next(results) == "fine done"
    results.close()
    for _ in range(200):
        if not active_children():
            return
        time.sleep(0.05)
    pytest.fail(f"still there: {active_children()}")


class Cluster:
    """A Dask scheduler and workers as processes of this machine."""

    def __init__(self, folder: Path, workers: int) -> None:
        self._told = folder / "scheduler.json"
        self._environment = os.environ | {"PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
        self._processes: list[subprocess.Popen] = []
        self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        self._await(self._told.exists, "the scheduler")
        self.address = json.loads(self._told.read_text())["address"]
        for _ in range(workers):
            self._start("worker", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")

    def _start(self, kind: str, *words: str) -> None:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--scheduler-file", str(self._told), *words]
        if kind == "worker":
            command += ["--local-directory", str(self._told.parent)]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._processes.append(subprocess.Popen(command, env=self._environment, start_new_session=True, **quiet))

    def _await(self, there, what: str) -> None:
        for _ in range(600):
            if there():
                return
            time.sleep(0.1)
        pytest.fail(f"{what} did not start within a minute")

    def close(self) -> None:
        for process in self._processes:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory) -> Iterator[Cluster]:
    pytest.importorskip("distributed", reason="Dask's distributed is not installed: pip install 'sixpoint[dask]'")
    started = Cluster(tmp_path_factory.mktemp("cluster"), 2)
    yield started
    started.close()


def test_a_cluster_does_the_same(run, folder, database, tmp_path, cluster):
    words = ("--database", database, "--ending", ".npz", "--json")
    status, printed, error = run(
        "batch", folder / "takes", "--out", tmp_path / "out", *words, "--dask", cluster.address
    )
    assert status == 2
    assert "broken.mcap" not in error
    assert json.loads(printed)["solved"] == 2
    here = solve_job(
        Job(str(folder / "takes" / "run.csv"), str(tmp_path / "here.npz"), given={"database__path": str(database)})
    )
    assert here.status == "solved"
    there = read_npz(tmp_path / "out" / "run.npz")
    assert np.array_equal(there.rotations, read_npz(tmp_path / "here.npz").rotations)


def test_a_killed_worker_of_a_cluster_takes_no_other_job_with_it(tmp_path, cluster):
    jobs = ["fine", f"once:{tmp_path}/marker", "fine", "fine"]
    assert sorted(by_cluster(perilous, jobs, gone, cluster.address)) == ["fine done"] * 3 + ["once done"]
    results = sorted(by_cluster(perilous, ["always", "fine"], gone, cluster.address))
    assert results[0].startswith("always lost: KilledWorker")
    assert results[1] == "fine done"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--ending", ".fbx"), ".bvh, .glb, .vrma, .csv, .npz"),
        (("--score", "nowhere"), "no such folder"),
        (("--with", "solver.speed=1"), "solver.method"),
        (("--joint-names", "maya"), "ours, blender"),
    ],
)
def test_what_cannot_be_is_said_before_anything_is_done(run, folder, tmp_path, words, message):
    status, _, error = run("batch", folder / "takes", "--out", tmp_path / "out", *words)
    assert (status, len(error.strip().splitlines())) == (2, 1)
    assert message in error
    assert not (tmp_path / "out").exists()


def test_a_scheduler_that_is_not_there_is_one_line(run, folder, database, tmp_path, monkeypatch):
    monkeypatch.setattr("capture.workers.PATIENCE", "0.5s")
    words = ("--database", database, "--dask", "tcp://127.0.0.1:9")
    status, _, error = run("batch", folder / "takes", "--out", tmp_path / "out", *words)
    assert status == 2
    assert "no scheduler answers" in error
