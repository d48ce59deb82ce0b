"""VRM animations, read back with pygltflib and kinematics of this file's own."""

import numpy as np
import pytest
from pygltflib import GLTF2
from scipy.spatial.transform import Rotation

from capture.export import write_motion
from capture.vrm_pose import vrm_motion
from capture.vrma import REQUIRED, write_vrma
from devices.errors import SettingError
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Motion
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton
from tests.capture.conftest import entries
from tests.capture.test_glb import posed_nodes


@pytest.fixture(scope="module")
def motion() -> Motion:
    skeleton, random = standard_skeleton(1.75), np.random.default_rng(8)
    turns = 0.4 * random.normal(size=(25, len(skeleton), 3))
    turns[:, skeleton.is_end] = 0
    rotations = Rotation.from_rotvec(turns.reshape(-1, 3)).as_quat().reshape(25, len(skeleton), 4)
    return Motion(skeleton, random.normal(size=(25, 3)) * 0.2 + [0, 1, 0], rotations, 60.0, "sway")


@pytest.fixture(scope="module")
def gltf(motion, tmp_path_factory) -> GLTF2:
    path = tmp_path_factory.mktemp("vrma") / "sway.vrma"
    write_vrma(motion, path)
    assert entries(path.parent) == {"sway.vrma"}
    return GLTF2().load_binary(str(path))


def test_it_says_which_node_is_which_bone(gltf):
    extension = gltf.extensions["VRMC_vrm_animation"]
    assert extension["specVersion"] == "1.0"
    assert gltf.extensionsUsed == ["VRMC_vrm_animation"]
    bones = extension["humanoid"]["humanBones"]
    assert set(REQUIRED) <= set(bones)
    assert all(gltf.nodes[bone["node"]].name == name for name, bone in bones.items())


def test_at_rest_it_stands_in_the_t_pose(gltf):
    names = [node.name for node in gltf.nodes]
    at = dict(zip(names, posed_nodes(gltf, None)[:, :3, 3], strict=True))
    assert all(np.allclose(node.rotation or [0, 0, 0, 1], [0, 0, 0, 1]) for node in gltf.nodes)
    for side, sign in (("left", 1), ("right", -1)):
        arm = at[f"{side}Hand"] - at[f"{side}UpperArm"]
        leg = at[f"{side}Foot"] - at[f"{side}UpperLeg"]
        assert arm / np.linalg.norm(arm) == pytest.approx([sign, 0, 0], abs=1e-5)
        assert leg / np.linalg.norm(leg) == pytest.approx([0, -1, 0], abs=1e-5)
    assert 0.8 < at["hips"][1] < 1.1
    assert at["head"][1] > at["neck"][1] > at["hips"][1]


@pytest.mark.parametrize("frame", [0, 11, 24])
def test_every_bone_is_where_it_was(gltf, motion, frame):
    there = world_transforms(motion.skeleton, motion.root_positions, motion.rotations)[frame, :, :3, 3]
    here = posed_nodes(gltf, frame)[:, :3, 3]
    by_name = {node.name: place for node, place in zip(gltf.nodes, here, strict=True)}
    for bone, joint in motion.skeleton.humanoid.items():
        first, *rest = bone.split("_")
        assert by_name[first + "".join(word.capitalize() for word in rest)] == pytest.approx(there[joint], abs=1e-5)


def test_only_the_hips_are_moved(gltf):
    moved = [channel.target.node for channel in gltf.animations[0].channels if channel.target.path == "translation"]
    assert moved == [gltf.extensions["VRMC_vrm_animation"]["humanoid"]["humanBones"]["hips"]["node"]]
    assert {channel.target.path for channel in gltf.animations[0].channels} == {"translation", "rotation"}


def test_bones_turn_as_the_body_does_whatever_its_own_axes(motion):
    turned = vrm_motion(motion)
    names, there = turned.skeleton.names, world_transforms(motion.skeleton, motion.root_positions, motion.rotations)
    here = world_transforms(turned.skeleton, turned.root_positions, turned.rotations)
    head, joint = names.index("head"), motion.skeleton.humanoid["head"]
    change_there = there[5, joint, :3, :3] @ there[0, joint, :3, :3].T
    change_here = here[5, head, :3, :3] @ here[0, head, :3, :3].T
    assert np.allclose(change_there, change_here, atol=1e-9)


def test_the_ending_is_enough_and_a_body_without_arms_is_refused(motion, tmp_path):
    write_motion(motion, tmp_path / "a.vrma", joint_names="blender")
    assert (tmp_path / "a.vrma").read_bytes()[:4] == b"glTF"
    legs = Skeleton(
        ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot"),
        np.array([-1, 0, 1, 2, 0, 4, 5], np.int32),
        np.array([[0, 1, 0], [0.1, 0, 0], [0, -0.4, 0], [0, -0.4, 0], [-0.1, 0, 0], [0, -0.4, 0], [0, -0.4, 0.0]]),
    )
    walker = Motion(legs, np.zeros((2, 3)), np.tile([0.0, 0, 0, 1], (2, 7, 1)), 60.0, "walker")
    with pytest.raises(SettingError, match="leftUpperArm"):
        write_vrma(walker, tmp_path / "b.vrma")
    assert not (tmp_path / "b.vrma").exists()
