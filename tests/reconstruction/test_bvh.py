"""BVH files: as found in the wild, broken, and there and back."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from devices.errors import FileError
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_files import read_bvh, read_motion, write_bvh
from reconstruction.motion_files.bvh import continuous_euler
from reconstruction.standard_body import standard_skeleton

MOCAP = Path(__file__).parents[2] / ".." / "shared" / "mocap"

SMALL = """HIERARCHY
ROOT Hips
{
\tOFFSET 0 0 0
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
\tJOINT left arm
\t{
\t\tOFFSET 10 0 0
\t\tCHANNELS 3 Yrotation Zrotation Xrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0 5e0 0
\t\t}
\t}
}
MOTION
Frames: 2
Frame Time: .0333333
0 100 0 0 0 0 90 0 0
1e1 100 0 0 0 0 0 90 0
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "clip.bvh"
    path.write_bytes(text.encode())
    return path


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """The largest angle, radians, between two arrays of quaternions; exact for small ones."""
    return float(2 * np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)).max())


def random_motion(rng: np.random.Generator, frames: int = 12) -> Motion:
    """A body that turns every joint every way, the poles of every Euler order included."""
    skeleton = standard_skeleton()
    steps = rng.normal(0, 0.4, (frames, len(skeleton), 3)).cumsum(axis=0)
    steps[:, skeleton.is_end] = 0
    rotations = Rotation.from_rotvec(steps.reshape(-1, 3)).as_quat().reshape(frames, len(skeleton), 4)
    return Motion(skeleton, rng.normal(0, 2, (frames, 3)), rotations, 60.0)


def test_a_small_file_gives_joints_end_sites_and_metres(tmp_path: Path) -> None:
    motion = read_bvh(written(tmp_path, SMALL))
    assert motion.skeleton.names == ("Hips", "left arm", "left arm_end")
    assert motion.fps == 30
    assert len(motion) == 2
    joints, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    # The end stands 5 cm along the arm's y; turned 90 degrees about z it stands along -x.
    np.testing.assert_allclose(joints[1], [[0.1, 1, 0], [0.2, 1, 0], [0.15, 1, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\n", "\r\n"),
        ("\t", "  "),
        ("Frame Time: .0333333", "Frame Time:\t3.33333e-2"),
        ("Frames: 2", "Frames:2"),
        ("ROOT Hips\n{", "ROOT Hips {"),
        ("0 100 0 0 0 0 90 0 0\n", "0 100 0 0 0 0 90 0 0  \n\n"),
        ("HIERARCHY", "\ufeffHIERARCHY"),
    ],
)
def test_forms_that_programs_write_read_alike(tmp_path: Path, old: str, new: str) -> None:
    plain = read_bvh(written(tmp_path, SMALL))
    other = read_bvh(written(tmp_path, SMALL.replace(old, new)))
    assert other.skeleton.names == plain.skeleton.names
    assert other.fps == plain.fps
    np.testing.assert_array_equal(other.rotations, plain.rotations)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("\n \n", "the file is empty"),
        ("time_s,tracker\n", "starts with"),
        (SMALL[: SMALL.index("MOTION")], "no MOTION section"),
        (SMALL[:-8], r"clip.bvh:20: \d values where the channels ask for 9; the file is cut off"),
        (SMALL[: SMALL.index("1e1")], "says 'Frames: 2' but holds 1"),
        (SMALL.replace("Frames: 2", "Frames: 3"), "says 'Frames: 3' but holds 2"),
        (SMALL.replace("Frames: 2", "Frames:"), "clip.bvh:17: a number is missing"),
        (SMALL.replace(".0333333", "0"), "must be above zero"),
        (SMALL.replace("1e1", "nan"), "clip.bvh:20: a value is NaN or infinite"),
        (SMALL.replace("1e1", "abc"), "clip.bvh:20: could not convert string to float: 'abc'"),
        (SMALL.replace("0 100 0 0 0 0 90 0 0", "0 100 0 0 0 0 90 0 0 7"), "clip.bvh:19: 10 values"),
        (SMALL.replace("CHANNELS 3 Y", "CHANNELS 2 Y"), "clip.bvh:9: CHANNELS needs a count"),
        (SMALL.replace("OFFSET 10 0 0", "OFFSET 10 0"), "clip.bvh:8: OFFSET needs three numbers"),
        (SMALL.replace("OFFSET 10 0 0\n", "\n"), "joint 'left arm' has no OFFSET"),
        (SMALL.replace("left arm", "Hips"), "a second joint named 'Hips'"),
        (SMALL.replace("}\n}\nMOTION", "}\nMOTION"), "brackets stay open"),
        (SMALL.replace("\tCHANNELS 6", "\tCANALS 6"), "unknown word 'CANALS'"),
    ],
)
def test_a_broken_file_says_what_and_where(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        read_bvh(written(tmp_path, text))


@given(st.integers(0, len(SMALL) - 1))
@settings(max_examples=60, deadline=None)
def test_a_file_cut_off_anywhere_is_an_error_or_whole(tmp_path_factory: pytest.TempPathFactory, cut: int) -> None:
    path = written(tmp_path_factory.mktemp("cut"), SMALL[:cut])
    try:
        motion, message = read_bvh(path), None
    except FileError as error:
        motion, message = None, str(error)
    if motion is None:
        assert message is not None
        assert "clip.bvh" in message
        assert "\n" not in message
    else:
        assert len(motion) == 2


def test_a_missing_file_and_an_unknown_ending_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.bvh: No such file"):
        read_motion(tmp_path / "none.bvh")
    with pytest.raises(FileError, match=r"use \.bvh or \.amc"):
        read_motion(tmp_path / "clip.fbx")


def test_positions_of_inner_joints_become_offsets_and_a_carrier_root_is_merged(tmp_path: Path) -> None:
    text = """HIERARCHY
ROOT carrier
{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
JOINT Hips
{
OFFSET 9 9 9
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
JOINT Spine
{
OFFSET 9 9 9
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
}
}
}
MOTION
Frames: 2
Frame Time: 0.04
10 0 0 90 0 0  0 100 0 0 0 0  0 12 0 0 0 0
10 0 0 90 0 0  50 100 0 0 0 0  0 12 0 0 0 0
"""
    motion = read_bvh(written(tmp_path, text))
    assert motion.skeleton.names == ("Hips", "Spine")
    np.testing.assert_allclose(motion.skeleton.offsets[1], [0, 0.12, 0])
    np.testing.assert_allclose(motion.root_positions, [[-0.9, 0, 0], [-0.9, 0.5, 0]], atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["ZXY", "ZYX", "XYZ", "YXZ"]))
@settings(max_examples=12, deadline=None)
def test_writing_and_reading_gives_the_motion_back(
    tmp_path_factory: pytest.TempPathFactory, seed: int, order: str
) -> None:
    motion = random_motion(np.random.default_rng(seed))
    path = tmp_path_factory.mktemp("bvh") / "clip.bvh"
    write_bvh(motion, path, order=order)
    back = read_bvh(path)
    # A hierarchy is written branch by branch.
    order_back = [back.skeleton.names.index(name) for name in motion.skeleton.names]
    assert distance(back.rotations[:, order_back], motion.rotations) < 1e-5
    np.testing.assert_allclose(back.root_positions, motion.root_positions, atol=1e-8)
    np.testing.assert_allclose(back.skeleton.offsets[order_back][1:], motion.skeleton.offsets[1:], atol=1e-8)
    assert back.fps == motion.fps
    assert [p.name for p in path.parent.iterdir()] == ["clip.bvh"]


def test_euler_angles_do_not_jump() -> None:
    turns = np.linspace(0, 6 * np.pi, 400)
    spin = Rotation.from_euler("ZXY", np.stack([turns, 0.4 * np.sin(turns), 0.3 * turns], -1)).as_quat()[:, None]
    over_the_pole = Rotation.from_euler("X", turns[:, None]).as_quat()[:, None]
    for rotations in (spin, over_the_pole):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            angles = continuous_euler(rotations, "ZXY")
        assert np.abs(np.diff(angles, axis=0)).max() < 0.2


@pytest.mark.skipif(not MOCAP.is_dir(), reason="shared motion capture is not beside the repository")
@pytest.mark.parametrize("name", ["cmu/cmu_train_running_2.bvh", "bandai1/dataset-1_run_old_001.bvh"])
def test_captured_motion_survives_writing(tmp_path: Path, name: str) -> None:
    motion = read_motion(MOCAP / name)
    write_bvh(motion, tmp_path / "back.bvh")
    back = read_motion(tmp_path / "back.bvh")
    assert back.skeleton.names == motion.skeleton.names
    assert distance(back.rotations, motion.rotations) < 1e-5
    assert distance(motion.rotations[1:], motion.rotations[:-1]) < 1.5
    assert np.sum(motion.rotations[1:] * motion.rotations[:-1], axis=-1).min() > 0
