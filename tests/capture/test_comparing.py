"""`reconstruct --with` and `--compare`: what a changed setting does."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from capture.comparing import compared, jitter_m_s3
from capture.comparison_report import markdown
from capture.export import read_npz
from capture.solving import SolvedTake
from devices.frame import frozen
from reconstruction.motion import Motion
from reconstruction.solution import Reconstruction
from reconstruction.standard_body import standard_skeleton
from tests.capture.conftest import entries


def solution(motion: Motion) -> SolvedTake:
    ones = np.ones(len(motion))
    states = np.ones((len(motion), 6), np.int8)
    return SolvedTake([], Reconstruction(motion, np.ones(motion.rotations.shape[:2]), ones, states, ones))


@pytest.fixture(scope="module")
def motion() -> Motion:
    skeleton, rng = standard_skeleton(1.75), np.random.default_rng(4)
    turns = Rotation.from_rotvec(0.3 * rng.normal(size=(20 * len(skeleton), 3))).as_quat()
    return Motion(skeleton, rng.normal(size=(20, 3)), turns.reshape(20, len(skeleton), 4), 60.0)


def test_a_solution_differs_by_nothing_from_itself(motion):
    same = compared("a", solution(motion), solution(replace(motion, rotations=-motion.rotations)))
    assert np.allclose(same.degrees, 0, atol=1e-6)
    assert np.allclose(same.centimetres, 0, atol=1e-9)


def test_differences_are_in_the_joint_and_at_the_moment_where_they_are(motion):
    elbow = motion.skeleton.names.index("LeftForeArm")
    rotations = motion.rotations.copy()
    bent = Rotation.from_quat(rotations[7, elbow]) * Rotation.from_rotvec([0, np.radians(25), 0])
    rotations[7, elbow] = bent.as_quat()
    other = compared("a", solution(motion), solution(replace(motion, rotations=rotations)))
    assert other.degrees[7, other.joints.index("LeftForeArm")] == pytest.approx(25)
    assert other.degrees.sum() == pytest.approx(25)
    figures = other.figures()
    assert figures["difference"]["cm_max_joint"] == "LeftHand"
    assert figures["difference"]["cm_max_at_s"] == pytest.approx(7 / 60, abs=1e-3)
    assert figures["by_joint"]["LeftForeArm"]["degrees_mean"] == pytest.approx(25 / 20)
    assert figures["by_joint"]["RightHand"]["cm_max"] == 0
    assert "| LeftForeArm | 1.25 | 0.00 |" in markdown([other, other], ["x=1"])


def test_a_shift_moves_every_joint_alike(motion):
    moved = replace(motion, root_positions=motion.root_positions + np.array([0.03, 0, 0.04]))
    other = compared("a", solution(motion), solution(moved))
    assert np.allclose(other.centimetres, 5.0)
    assert np.allclose(other.degrees, 0, atol=1e-6)


def test_another_rate_is_compared_at_the_same_times(motion):
    skeleton, identity = motion.skeleton, np.tile([0.0, 0, 0, 1], (41, len(motion.skeleton), 1))
    x = np.linspace(0, 1, 41)[:, None] * [1.0, 0, 0]
    slow = Motion(skeleton, frozen(x[::2].copy()), frozen(identity[::2].copy()), 30.0)
    fast = Motion(skeleton, frozen(x), frozen(identity), 60.0)
    other = compared("a", solution(slow), solution(fast))
    assert other.centimetres.shape[0] == 21
    assert np.allclose(other.centimetres, 0, atol=1e-9)


def test_jitter_is_the_mean_jerk(motion):
    seconds = np.arange(30) / 60
    path = np.stack([seconds**3, 0 * seconds, 0 * seconds], 1)
    identity = np.tile([0.0, 0, 0, 1], (30, len(motion.skeleton), 1))
    assert jitter_m_s3(Motion(motion.skeleton, path, identity, 60.0)) == pytest.approx(6.0)
    assert jitter_m_s3(Motion(motion.skeleton, path[:3], identity[:3], 60.0)) == 0.0


def test_a_comparison_is_reported_beside_the_motion(run, tmp_path, database, tracks):
    out = tmp_path / "b.npz"
    change = ("--with", "solver.method=paper", "--compare", "--json")
    status, printed, error = run("reconstruct", tracks, "--database", database, "--out", out, *change)
    assert status == 0, error
    assert entries(tmp_path) == {"b.npz", "b.comparison.md", "b.comparison.json", "b.comparison.png"}
    told = json.loads(printed)
    (take,) = told["takes"]
    assert told["changes"] == ["solver.method=paper"]
    assert take["difference"]["cm_mean"] > 0.01
    assert take["difference"]["degrees_mean"] > 0.1
    kept = json.loads((tmp_path / "b.comparison.json").read_text())
    assert len(kept["takes"][0]["over_time"]["cm"]) == take["before"]["poses"] == len(read_npz(out))
    with Image.open(tmp_path / "b.comparison.png") as plot:
        assert plot.width > 800
    alone = tmp_path / "alone.npz"
    assert run("reconstruct", tracks, "--database", database, "--out", alone, "--method", "paper")[0] == 0
    assert np.array_equal(read_npz(alone).rotations, read_npz(out).rotations)


def test_several_takes_are_compared_into_a_folder(run, tmp_path, database, tracks):
    shorter = tmp_path / "shorter.csv"
    shorter.write_text("".join(tracks.read_text().splitlines(keepends=True)[:250]))
    out = tmp_path / "report"
    words = ("--database", database, "--with", "solver.noise_gain=0", "--with", "solver.local.pose_floor=0.05")
    status, printed, error = run("reconstruct", tracks, shorter, *words, "--compare", "--out", out)
    assert status == 0, error
    assert entries(out) == {
        "comparison.md", "comparison.json", "comparison_walk.png", "comparison_shorter.png",
    }  # fmt: skip
    assert "| shorter.csv | before |" in printed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--compare",), "--with"),
        (("--with", "solver.methd=paper"), "solver.method"),
        (("--with", "character.delta=0.1"), "changes no pose"),
        (("--with", "device.suit.beta=1"), "tracks have no device"),
        (("--joint-names", "maya"), "ours, blender, cmu"),
        (("--method", "magic"), "default, paper"),
    ],
)
def test_wrong_changes_are_one_line(run, tmp_path, database, tracks, words, message):
    status, _, error = run("reconstruct", tracks, "--database", database, "--out", tmp_path / "a.bvh", *words)
    assert status == 2
    assert message in error
    assert "Traceback" not in error
    assert entries(tmp_path) == set()


def test_several_takes_need_a_comparison_and_that_a_folder(run, tmp_path, tracks):
    for words, message in (((), "sixpoint batch"), (("--with", "trackers=head,root", "--compare"), "a folder")):
        status, _, error = run("reconstruct", tracks, tracks, "--out", tmp_path / "a.bvh", *words)
        assert (status, message in error) == (2, True)


def test_joints_are_called_as_the_program_wants_them(run, tmp_path, database, tracks):
    words = ("--database", database, "--joint-names", "mixamo", "--out", tmp_path / "a.npz")
    assert run("reconstruct", tracks, *words)[0] == 0
    assert {"mixamorig:Hips", "mixamorig:LeftHand"} <= set(read_npz(tmp_path / "a.npz").skeleton.names)
