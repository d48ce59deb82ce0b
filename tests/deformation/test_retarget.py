"""Retargeting: what a pose means is kept, whatever the rest pose and the proportions."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

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
        assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.1
    toes = here[:, [target.humanoid["left_toes"], target.humanoid["right_toes"]], 1].min(axis=1)
    assert toes.min() > 0.02
    assert np.median(toes) < 0.06


def test_a_skeleton_without_feet_and_a_foreign_motion_are_refused():
    target = renamed(standard_skeleton(), {"LeftFoot": "hoof"})
    with pytest.raises(SixpointError, match="left_foot"):
        Retargeter(standard_skeleton(), target)
    with pytest.raises(SixpointError, match="another skeleton"):
        Retargeter(standard_skeleton(), standard_skeleton()).motion(swinging(target))
