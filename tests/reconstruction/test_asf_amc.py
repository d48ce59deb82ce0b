"""Acclaim files: units, axes, limits, and the same trial as BVH."""

from pathlib import Path

import numpy as np
import pytest

from devices.errors import FileError
from reconstruction.kinematics import world_joints
from reconstruction.motion_files import read_amc, read_asf, read_bvh, read_motion
from reconstruction.motion_files.asf_amc import INCH_M

ACCLAIM = Path(__file__).parents[2] / ".." / "shared" / "mocap" / "asf_amc"

ASF = """:version 1.10
:units
  mass 1.0
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
 begin
  id 1
  name upper
  direction 1 0 0
  length 4.5
  axis 0 0 90 XYZ
  dof rx rz
  limits (-90 90)
         (0.0 45.0)
 end
 begin
  id 2
  name lower
  direction 1 0 0
  length 9
  axis 0 0 0 XYZ
 end
:hierarchy
 begin
  root upper
  upper lower
 end
"""
AMC = """#!OML:ASF somewhere
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 0 0
upper 0 0
2
root 1 2 3 0 90 0
upper 90 0
"""


def pair(folder: Path, asf: str = ASF, amc: str = AMC) -> Path:
    (folder / "07.asf").write_text(asf)
    (folder / "07_01.amc").write_text(amc)
    return folder / "07_01.amc"


def test_units_axes_and_tails(tmp_path: Path) -> None:
    unit = INCH_M / 0.45
    motion = read_motion(pair(tmp_path))
    assert motion.skeleton.names == ("root", "upper", "lower", "lower_end")
    assert motion.fps == 120
    joints, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    np.testing.assert_allclose(joints[0] / unit, [[1, 2, 3], [1, 2, 3], [5.5, 2, 3], [14.5, 2, 3]], atol=1e-9)
    # The upper bone's own x axis is the world's y at rest: 90 degrees about it point the bone along -z; the root's
    # 90 degrees about y then turn -z to -x.
    np.testing.assert_allclose(joints[1] / unit, [[1, 2, 3], [1, 2, 3], [-3.5, 2, 3], [-12.5, 2, 3]], atol=1e-9)


def test_limits_bound_what_the_limited_angles_can_do(tmp_path: Path) -> None:
    pair(tmp_path)
    limits = read_asf(tmp_path / "07.asf").skeleton.limits
    assert limits is not None
    assert limits[1, 1, 0] == pytest.approx(-np.pi / 2)
    assert limits[1, 1, 1] == pytest.approx(np.pi / 2)
    assert limits[1, 2, 1] == pytest.approx(np.pi / 4)
    np.testing.assert_array_equal(limits[2], np.zeros((3, 2)))
    np.testing.assert_array_equal(limits[0], [[-np.pi, np.pi]] * 3)


@pytest.mark.parametrize(
    ("asf", "amc", "message"),
    [
        (ASF, "", "07_01.amc: the file is empty"),
        (ASF, AMC[: AMC.index("\nupper 90")], "'upper' stands 1 times in 2 frames"),
        (ASF, AMC[:-3], "07_01.amc:9: 1 values for 'upper', which has 2"),
        (ASF, AMC.replace("90 0\n", "nan 0\n"), "a value is NaN or infinite"),
        (ASF, AMC.replace("upper", "tail"), "07_01.amc:6: bone 'tail' is not in the skeleton"),
        (ASF, ":DEGREES\n", "holds no frames"),
        (ASF[: ASF.index(":hierarchy")], AMC, "07.asf: no :hierarchy"),
        (ASF.replace(" end\n:hier", ":hier"), AMC, "07.asf: a block begins and does not end"),
        (ASF.replace("direction 1 0 0", "direction 1 x 0"), AMC, "07.asf:15: 3 numbers are needed"),
        (ASF.replace("upper lower", "upper lover"), AMC, "bone 'lover' is not in :bonedata"),
    ],
)
def test_a_broken_file_says_what_and_where(tmp_path: Path, asf: str, amc: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        read_amc(pair(tmp_path, asf, amc))


def test_a_motion_without_its_skeleton_says_which_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "07_01.amc"
    path.write_text(AMC)
    with pytest.raises(FileError, match=r"put 07\.asf into its folder"):
        read_amc(path)


@pytest.mark.skipif(not ACCLAIM.is_dir(), reason="shared motion capture is not beside the repository")
def test_cmu_trial_01_01_agrees_with_its_bvh() -> None:
    acclaim = read_amc(ACCLAIM / "01_01.amc")
    # The conversion keeps the file's units, puts a rest pose in front, and drops the thorax's length: above it only
    # rotations can agree.
    converted = read_bvh(ACCLAIM / "01_01.bvh", unit_m=INCH_M / 0.45)
    a_joints, a_turns = world_joints(acclaim.skeleton, acclaim.root_positions, acclaim.rotations)
    b_joints, b_turns = world_joints(converted.skeleton, converted.root_positions[1:], converted.rotations[1:])
    names = {"root": "Hips", "thorax": "Spine1", "head": "Head", "lowerneck": "Neck", "lhumerus": "LeftArm"}
    names |= {f"{a}{bone}": f"{b}{joint}" for a, b in (("l", "Left"), ("r", "Right")) for bone, joint in LIMBS.items()}
    for ours, theirs in names.items():
        a, b = acclaim.skeleton.names.index(ours), converted.skeleton.names.index(theirs)
        np.testing.assert_allclose(a_turns[:, a], b_turns[:, b], atol=2e-5)
        if ours in ("root", "thorax") or ours[1:] in ("femur", "tibia", "foot", "toes"):
            np.testing.assert_allclose(a_joints[:, a], b_joints[:, b], atol=2e-5)
    for role in ("root", "head", "left_wrist", "right_ankle"):
        assert acclaim.skeleton.role_joint(role) >= 0
    assert acclaim.skeleton.names[acclaim.skeleton.role_joint("left_wrist")] == "lwrist"


LIMBS = {"femur": "UpLeg", "tibia": "Leg", "foot": "Foot", "toes": "ToeBase", "radius": "ForeArm", "wrist": "Hand"}
