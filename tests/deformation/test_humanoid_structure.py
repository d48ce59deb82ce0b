"""Which joint is which bone: other makers' names, and names that say nothing."""

import numpy as np
import pytest
from numpy.typing import NDArray

from deformation.humanoid_structure import humanoid_bones
from reconstruction.joint_names import humanoid_names
from reconstruction.kinematics import world_joints
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

_LIMBS = [
    f"{side}_{bone}"
    for side in ("left", "right")
    for bone in ("upper_arm", "lower_arm", "hand", "upper_leg", "lower_leg", "foot")
]

_UNREAL = {"Shoulder": "clavicle", "Arm": "upperarm", "ForeArm": "lowerarm", "Hand": "hand", "UpLeg": "thigh"}
_UNREAL |= {"Leg": "calf", "Foot": "foot", "ToeBase": "ball"}
_RIGIFY = _UNREAL | {"Shoulder": "shoulder", "Arm": "upper_arm", "ForeArm": "forearm", "Leg": "shin", "ToeBase": "toe"}
_MAKEHUMAN = _UNREAL | {"Arm": "upperarm01", "ForeArm": "lowerarm01", "Hand": "wrist", "UpLeg": "upperleg01"}
_MAKEHUMAN |= {"Leg": "lowerleg01", "ToeBase": "toe1-1"}
_UNITY = {"Arm": "UpperArm", "ForeArm": "LowerArm", "UpLeg": "UpperLeg", "Leg": "LowerLeg", "ToeBase": "Toes"}
_BIPED = {"Shoulder": "Clavicle", "Arm": "UpperArm", "UpLeg": "Thigh", "Leg": "Calf", "ToeBase": "Toe0"}

_MAKERS = {
    "Mixamo": (("mixamorig:Hips", "mixamorig:Spine", "mixamorig:Neck", "mixamorig:Head"), "mixamorig:{S}{B}", {}),
    "three.js": (("mixamorig1Hips", "mixamorig1Spine", "mixamorig1Neck", "mixamorig1Head"), "mixamorig1{S}{B}", {}),
    "VRoid": (("J_Bip_C_Hips", "J_Bip_C_Spine", "J_Bip_C_Neck", "J_Bip_C_Head"), "J_Bip_{L}_{B}", _UNITY),
    "Unity": (("Hips", "Spine", "Neck", "Head"), "{S}{B}", _UNITY),
    "MakeHuman": (("root", "spine05", "neck01", "head"), "{B}.{L}", _MAKEHUMAN),
    "Rigify": (("DEF-spine", "DEF-spine.001", "DEF-spine.004", "DEF-spine.006"), "DEF-{B}.{L}", _RIGIFY),
    "Unreal": (("pelvis", "spine_01", "neck_01", "head"), "{B}_{l}", _UNREAL),
    "3ds Max": (("Bip001 Pelvis", "Bip001 Spine", "Bip001 Neck", "Bip001 Head"), "Bip001 {L} {B}", _BIPED),
}
"""Names of hips, lowest spine, neck and head; how a sided joint is called; its part, where not as in our skeleton."""


def named_by(maker: str) -> tuple[Skeleton, NDArray[np.float64]]:
    """Our skeleton with a maker's names, and its joints (J, 3) in the rest pose."""
    plain = standard_skeleton()
    centre_names, pattern, parts = _MAKERS[maker]
    centre = dict(zip(("Hips", "Spine", "Neck", "Head"), centre_names, strict=True))
    names = []
    for name in plain.names:
        side = "Left" if name.startswith("Left") else "Right"
        part = name.removeprefix(side)
        if name in centre:
            names.append(centre[name])
        elif name.endswith("_end") or name.startswith("Spine"):
            names.append(f"joint {len(names)}")
        else:
            names.append(pattern.format(S=side, L=side[0], l=side[0].lower(), B=parts.get(part, part)))
    positions, _ = world_joints(plain, plain.offsets[0], np.tile([0.0, 0, 0, 1], (len(plain), 1)))
    return Skeleton(tuple(names), plain.parents, plain.offsets), positions


@pytest.mark.parametrize("maker", _MAKERS)
def test_makers_names_are_known(maker: str):
    skeleton, positions = named_by(maker)
    bones = humanoid_bones(skeleton.names, skeleton.parents, positions)
    truth = standard_skeleton().humanoid
    for bone in ("hips", "head", "neck", *_LIMBS, "left_shoulder", "right_toes"):
        assert bones[bone] == truth[bone], bone
    assert bones["spine"] == truth["spine"]


@pytest.mark.parametrize("mirrored", [False, True])
def test_names_that_say_nothing_leave_it_to_the_structure(mirrored: bool):
    plain = standard_skeleton()
    positions, _ = world_joints(plain, plain.offsets[0], np.tile([0.0, 0, 0, 1], (len(plain), 1)))
    names = [f"Bone.{n:03}" for n in range(len(plain))]
    if mirrored:
        positions = positions * [-1, 1, 1]
        names[plain.humanoid["left_hand"]] = "hand.L"
        names[plain.humanoid["right_hand"]] = "hand.R"
    bones = humanoid_bones(names, plain.parents, positions)
    for bone in ("hips", "head", "neck", *_LIMBS):
        assert bones[bone] == plain.humanoid[bone], bone


def test_what_the_file_says_goes_before_names():
    plain = standard_skeleton()
    positions, _ = world_joints(plain, plain.offsets[0], np.tile([0.0, 0, 0, 1], (len(plain), 1)))
    said = {"left_hand": plain.names.index("LeftHand_end")}
    assert humanoid_bones(plain.names, plain.parents, positions, said)["left_hand"] == said["left_hand"]


def test_what_is_no_person_gets_no_limbs():
    names, parents = ["a", "b", "c", "d"], np.array([-1, 0, 1, 2], np.int32)
    bones = humanoid_bones(names, parents, np.array([[0, n, 0.0] for n in range(4)]))
    assert bones == {}


def test_our_own_bones_names_are_known_as_themselves():
    bones = list(standard_skeleton().humanoid)
    assert humanoid_names(bones) == {bone: n for n, bone in enumerate(bones)}
