from pathlib import Path

import numpy as np
import pytest

from capture.export import write_motion
from capture.joint_presets import PRESETS, renamed
from devices.errors import SettingError
from reconstruction.motion import Motion
from reconstruction.motion_files import read_bvh
from reconstruction.standard_body import standard_skeleton

CMU = Path(__file__).parents[2] / ".." / "shared" / "mocap" / "cmu"


@pytest.fixture
def motion() -> Motion:
    skeleton = standard_skeleton()
    return Motion(skeleton, np.zeros((2, 3)), np.tile([0.0, 0, 0, 1], (2, len(skeleton), 1)), 30.0)


@pytest.mark.parametrize(
    ("preset", "names"),
    [
        ("mixamo", {"left_lower_arm": "mixamorig:LeftForeArm", "hips": "mixamorig:Hips"}),
        ("motionbuilder", {"right_foot": "RightFoot", "upper_chest": "Spine2"}),
        ("cmu", {"spine": "LowerBack", "chest": "Spine"}),
        ("blender", {"hips": "spine", "left_lower_arm": "forearm.L", "right_toes": "toe.R"}),
    ],
)
def test_humanoid_joints_get_the_names_of_the_preset(motion, preset, names):
    skeleton = renamed(motion, preset).skeleton
    for bone, name in names.items():
        assert skeleton.names[motion.skeleton.humanoid[bone]] == name
    assert len(set(skeleton.names)) == len(skeleton)
    assert np.array_equal(skeleton.is_end, motion.skeleton.is_end)


@pytest.mark.parametrize("preset", ["mixamo", "motionbuilder", "cmu"])
def test_a_file_with_those_names_is_understood_again(motion, preset, tmp_path):
    write_motion(motion, tmp_path / "a.bvh", joint_names=preset)
    back = read_bvh(tmp_path / "a.bvh").skeleton
    expected = renamed(motion, preset).skeleton
    for bone, joint in motion.skeleton.humanoid.items():
        assert back.names[back.humanoid[bone]] == expected.names[joint]


@pytest.mark.parametrize("preset", list(PRESETS))
def test_names_stay_single_on_captured_skeletons(preset):
    clips = sorted(CMU.glob("*.bvh"))
    if not clips:
        pytest.skip("no captured motion beside the repository (../shared/mocap/cmu)")
    given = read_bvh(clips[0])
    skeleton = renamed(given, preset).skeleton
    assert len(set(skeleton.names)) == len(skeleton)
    assert np.array_equal(skeleton.is_end, given.skeleton.is_end)


def test_an_unknown_preset_lists_the_known_ones(motion):
    with pytest.raises(SettingError, match="blender, cmu, mixamo, motionbuilder"):
        renamed(motion, "maya")
