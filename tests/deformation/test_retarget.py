"""Retargeting: what a pose means is kept, whatever the rest pose and the proportions."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deformation.bind_pose import bind_pose
from deformation.foot_placement import make_leg, reaching
from deformation.retarget import Retargeter
from devices.errors import SixpointError
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_files.bvh import read_bvh
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

_MOCAP = Path(__file__).parents[2] / ".." / "shared" / "mocap"
_LIMBS = [
    (f"{side}_{start}", f"{side}_{end}")
    for side in ("left", "right")
    for start, end in (
        ("upper_arm", "lower_arm"),
        ("lower_arm", "hand"),
        ("upper_leg", "lower_leg"),
        ("lower_leg", "foot"),
    )
]


def swinging(skeleton: Skeleton, frames: int = 12) -> Motion:
    """Small random turns of every joint while the body moves ahead."""
    random = np.random.default_rng(4)
    still = random.normal(size=(1, len(skeleton), 3)) * 0.15
    swing = random.normal(size=(1, len(skeleton), 3)) * 0.15 * np.linspace(-1, 1, frames)[:, None, None]
    rotations = Rotation.from_rotvec((still + swing).reshape(-1, 3)).as_quat().reshape(frames, -1, 4)
    path = np.stack([np.zeros(frames), np.full(frames, 1.15), np.linspace(0, 1.2, frames)], axis=1)
    return Motion(skeleton, path, rotations, 60.0)


def renamed(skeleton: Skeleton, names: dict[str, str]) -> Skeleton:
    return Skeleton(tuple(names.get(n, n) for n in skeleton.names), skeleton.parents, skeleton.offsets)


def test_the_same_skeleton_gets_the_same_motion():
    motion = swinging(standard_skeleton())
    carried = Retargeter(motion.skeleton, motion.skeleton).motion(motion)
    assert np.allclose(carried.root_positions, motion.root_positions, atol=1e-6)
    turns = (
        Rotation.from_quat(carried.rotations.reshape(-1, 4)) * Rotation.from_quat(motion.rotations.reshape(-1, 4)).inv()
    )
    mapped = list(motion.skeleton.humanoid.values())
    assert np.degrees(turns.magnitude().reshape(len(motion), -1)[:, mapped]).max() < 1e-4


def test_another_size_and_other_names_keep_every_limbs_direction():
    motion = swinging(standard_skeleton(1.75))
    target = renamed(standard_skeleton(1.2), {"LeftArm": "upperarm_l", "RightLeg": "mixamorig:RightLeg"})
    retargeter = Retargeter(motion.skeleton, target)
    carried = retargeter.motion(motion)
    assert retargeter.scale == pytest.approx(1.2 / 1.75, rel=1e-6)
    there, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    here, _ = world_joints(target, carried.root_positions, carried.rotations)
    assert np.allclose(here[:, 0], there[:, 0] * retargeter.scale, atol=1e-6)
    for start, end in _LIMBS:
        a = there[:, motion.skeleton.humanoid[end]] - there[:, motion.skeleton.humanoid[start]]
        b = here[:, target.humanoid[end]] - here[:, target.humanoid[start]]
        cosine = np.einsum("ti,ti->t", a, b) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
        assert cosine.min() > 1 - 1e-9


def test_one_pose_is_what_the_motion_has_there():
    motion = swinging(standard_skeleton())
    retargeter = Retargeter(motion.skeleton, standard_skeleton(1.9))
    pose = retargeter.pose(motion.pose(5))
    whole = retargeter.motion(motion)
    assert np.allclose(pose.root_position, whole.root_positions[5])
    assert np.allclose(pose.rotations, whole.rotations[5])


@pytest.mark.parametrize("clip", ["cmu/cmu_train_walking_1.bvh", "bandai1/dataset-1_walk_happy_001.bvh"])
def test_real_walks_keep_directions_and_the_floor(clip: str):
    if not (_MOCAP / clip).is_file():
        pytest.skip("needs the shared motion capture beside the repository")
    motion = read_bvh(_MOCAP / clip)
    target = standard_skeleton(1.75)
    carried = Retargeter(motion.skeleton, target, motion.pose(0)).motion(motion)
    there, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    here, _ = world_joints(target, carried.root_positions, carried.rotations)
    for start, end in _LIMBS:
        a = there[:, motion.skeleton.humanoid[end]] - there[:, motion.skeleton.humanoid[start]]
        b = here[:, target.humanoid[end]] - here[:, target.humanoid[start]]
        cosine = np.einsum("ti,ti->t", a, b) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
        angles = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        assert angles.max() < (25 if "leg" in start else 0.1), "only legs bend, and no more than to reach the floor"
        assert angles.mean() < 8
    toes = here[:, [target.humanoid["left_toes"], target.humanoid["right_toes"]], 1].min(axis=1)
    assert toes.min() > 0.02
    assert np.median(toes) < 0.06


def stepping(skeleton: Skeleton, frames: int = 120) -> Motion:
    """On the spot: the left foot stands while the hips sway and sink and the right leg swings."""
    phase = np.linspace(0, 2 * np.pi, frames)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(skeleton), 1))
    for name, vector in (("RightUpLeg", (-0.6, 0, 0)), ("RightLeg", (0.9, 0, 0)), ("RightFoot", (0.3, 0, 0))):
        turn = (0.5 - 0.5 * np.cos(phase))[:, None] * vector
        rotations[:, skeleton.names.index(name)] = Rotation.from_rotvec(turn).as_quat()
    sway = np.stack([0.03 * np.sin(phase), 0.03 * np.cos(phase) - 0.05, 0.03 * np.sin(2 * phase)], axis=1)
    path = skeleton.offsets[0] + sway
    at, turns = world_joints(skeleton, path, rotations)
    thigh, shank, foot = (skeleton.names.index(name) for name in ("LeftUpLeg", "LeftLeg", "LeftFoot"))
    leg = make_leg(thigh, shank, foot, world_joints(skeleton, *bind_pose(skeleton))[1])
    stand = np.tile(at[:, foot].mean(axis=0) * [1, 0, 1] + [0, 0.075, 0], (frames, 1))
    turned, bent = reaching(leg, at, turns, stand)
    rotations[:, thigh] = Rotation.from_matrix(turned).as_quat()
    rotations[:, shank] = Rotation.from_matrix(turned.transpose(0, 2, 1) @ bent).as_quat()
    rotations[:, foot] = Rotation.from_matrix(bent.transpose(0, 2, 1)).as_quat()
    return Motion(skeleton, path, rotations, 60.0)


@pytest.mark.parametrize(("thigh", "foot", "hips"), [(0.85, 1.0, 1.0), (1.15, 1.3, 1.0), (1.0, 0.7, 1.6)])
def test_a_foot_that_stands_stands_on_other_proportions_too(thigh: float, foot: float, hips: float):
    motion = stepping(standard_skeleton())
    offsets = standard_skeleton(1.4).offsets.copy()
    for side in ("Left", "Right"):
        for name, factor in ((f"{side}Leg", thigh), (f"{side}ToeBase", foot), (f"{side}UpLeg", hips)):
            offsets[motion.skeleton.names.index(name)] *= factor
    target = Skeleton(motion.skeleton.names, motion.skeleton.parents, offsets)
    carried = Retargeter(motion.skeleton, target).motion(motion)
    at, _ = world_joints(target, carried.root_positions, carried.rotations)
    ball = at[:, target.names.index("LeftToeBase")]
    assert np.ptp(ball, axis=0).max() < 2e-3
    assert np.ptp(at[:, 0, 0]) > 0.02, "the hips sway"
    assert np.abs(np.diff(carried.rotations, axis=0)).max() < 0.05, "and nothing snaps"


def test_fingers_follow_by_name():
    def handed(skeleton: Skeleton) -> Skeleton:
        hand = skeleton.names.index("LeftHand")
        names = (*skeleton.names, "LeftHandIndex1")
        return Skeleton(names, np.append(skeleton.parents, hand).astype(np.int32),
                        np.concatenate([skeleton.offsets, [[0.08, 0, 0]]]))  # fmt: skip

    motion = swinging(handed(standard_skeleton()))
    carried = Retargeter(motion.skeleton, handed(standard_skeleton(1.5))).motion(motion)
    assert np.allclose(np.abs((carried.rotations[:, -1] * motion.rotations[:, -1]).sum(axis=1)), 1)


def test_a_skeleton_without_feet_and_a_foreign_motion_are_refused():
    target = renamed(standard_skeleton(), {"LeftFoot": "hoof"})
    with pytest.raises(SixpointError, match="left_foot"):
        Retargeter(standard_skeleton(), target)
    with pytest.raises(SixpointError, match="another skeleton"):
        Retargeter(standard_skeleton(), standard_skeleton()).motion(swinging(target))
