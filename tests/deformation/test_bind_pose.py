"""The bind pose by its joint positions, on skeletons whose rest poses differ as much as files' do."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.bind_pose import bind_pose
from devices.errors import SixpointError
from reconstruction.kinematics import world_joints
from reconstruction.motion import Pose
from reconstruction.motion_files.bvh import read_bvh
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton
from reconstruction.stature import stature

_MOCAP = Path(__file__).parents[2] / ".." / "shared" / "mocap"
_CLIPS = {
    "standard": None,
    "cmu": _MOCAP / "cmu" / "cmu_train_walking_1.bvh",
    "bandai": _MOCAP / "bandai1" / "dataset-1_walk_happy_001.bvh",
}


@pytest.fixture(params=_CLIPS)
def clip(request: pytest.FixtureRequest) -> tuple[Skeleton, Pose | None]:
    """A skeleton and a pose of its motion."""
    path = _CLIPS[request.param]
    if path is None:
        return standard_skeleton(), None
    if not path.is_file():
        pytest.skip("needs the shared motion capture beside the repository")
    motion = read_bvh(path)
    return motion.skeleton, motion.pose(0)


def posed(skeleton: Skeleton, reference: Pose | None = None) -> dict[str, NDArray[np.float64]]:
    """World position (3,) by humanoid bone in the bind pose."""
    position, _ = world_joints(skeleton, *bind_pose(skeleton, reference))
    return {bone: position[joint] for bone, joint in skeleton.humanoid.items()}


def _angle(vector: NDArray[np.float64], direction: tuple[float, float, float]) -> float:
    cosine = vector @ np.array(direction) / (np.linalg.norm(vector) * np.linalg.norm(direction))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def test_limbs_are_straight_and_point_where_they_should(clip: tuple[Skeleton, Pose | None]):
    at = posed(*clip)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for start, end in (("upper_arm", "lower_arm"), ("lower_arm", "hand")):
            assert _angle(at[f"{side}_{end}"] - at[f"{side}_{start}"], (sign, -1.0, 0.0)) < 0.01
        for start, end in (("upper_leg", "lower_leg"), ("lower_leg", "foot")):
            leg = at[f"{side}_{end}"] - at[f"{side}_{start}"]
            assert 3 < _angle(leg, (0.0, -1.0, 0.0)) < 10
            assert sign * leg[0] > 0
            assert abs(leg[2]) < 1e-6
        assert _angle((at[f"{side}_toes"] - at[f"{side}_foot"]) * [1, 0, 1], (0.0, 0.0, 1.0)) < 12


def test_upright_facing_ahead_with_feet_on_the_floor(clip: tuple[Skeleton, Pose | None]):
    skeleton, reference = clip
    at = posed(skeleton, reference)
    assert _angle(at["head"] - at["hips"], (0.0, 1.0, 0.0)) < 5
    assert _angle(at["left_upper_leg"] - at["right_upper_leg"], (1.0, 0.0, 0.0)) < 1
    assert _angle(at["left_upper_arm"] - at["right_upper_arm"], (1.0, 0.0, 0.0)) < 2
    lowest = min(at["left_toes"][1], at["right_toes"][1])
    assert 0.01 * stature(skeleton) < lowest < 0.03 * stature(skeleton)


def test_bones_keep_their_lengths(clip: tuple[Skeleton, Pose | None]):
    skeleton, reference = clip
    position, _ = world_joints(skeleton, *bind_pose(skeleton, reference))
    bones = np.flatnonzero(skeleton.parents >= 0)
    lengths = np.linalg.norm(position[bones] - position[skeleton.parents[bones]], axis=1)
    assert np.allclose(lengths, np.linalg.norm(skeleton.offsets[bones], axis=1))


def test_a_t_pose_turns_each_arm_in_the_frontal_plane_only():
    skeleton = standard_skeleton()
    _, rotations = bind_pose(skeleton)
    for side, angle in (("left", -45.0), ("right", 45.0)):
        turn = Rotation.from_quat(rotations[skeleton.humanoid[f"{side}_upper_arm"]])
        assert np.allclose(turn.as_rotvec(degrees=True), [0, 0, angle], atol=1e-6)
        assert Rotation.from_quat(rotations[skeleton.humanoid[f"{side}_lower_arm"]]).magnitude() < 1e-9


def test_the_reference_pose_does_not_matter_where_the_rest_pose_is_one():
    skeleton = standard_skeleton()
    bent = Rotation.random(len(skeleton), rng=np.random.default_rng(1)).as_quat()
    root, rotations = bind_pose(skeleton, Pose(0.0, np.array([3.0, 1.0, 2.0]), bent))
    plain_root, plain_rotations = bind_pose(skeleton)
    assert np.array_equal(root, plain_root)
    assert np.array_equal(rotations, plain_rotations)


def along_one_axis(skeleton: Skeleton, names: tuple[str, ...]) -> tuple[Skeleton, Pose]:
    """The same body with every bone of `names` along its parent's X, and its T-pose as a pose of it."""
    position, _ = world_joints(skeleton, np.array([0.0, 1.0, 0.0]), np.tile([0.0, 0, 0, 1], (len(skeleton), 1)))
    world = np.tile(np.eye(3), (len(skeleton), 1, 1))
    for joint, name in enumerate(skeleton.names):
        child = next((c for c in skeleton.children[joint] if skeleton.names[c] in names), None)
        if child is not None and name in names:
            x = (position[child] - position[joint]) / np.linalg.norm(position[child] - position[joint])
            z = np.cross(x, [0.0, 0.3, 0.8])
            z /= np.linalg.norm(z)
            world[joint] = np.stack([x, np.cross(z, x), z], axis=1)
        elif skeleton.parents[joint] >= 0:
            world[joint] = world[skeleton.parents[joint]]
    offsets, rotations = skeleton.offsets.copy(), np.tile([0.0, 0, 0, 1], (len(skeleton), 1))
    for joint, parent in enumerate(skeleton.parents):
        above = world[parent] if parent >= 0 else np.eye(3)
        rotations[joint] = Rotation.from_matrix(above.T @ world[joint]).as_quat()
        if parent >= 0:
            offsets[joint] = above.T @ (position[joint] - position[parent])
    return Skeleton(skeleton.names, skeleton.parents, offsets), Pose(0.0, position[0], rotations)


def test_bones_along_one_axis_take_the_reference_and_stand_alike():
    plain = standard_skeleton()
    limbs = tuple(
        n for n in plain.names if not n.endswith("_end") and n not in ("Hips", "LeftShoulder", "RightShoulder")
    )
    skeleton, reference = along_one_axis(plain, limbs)
    there, here = posed(skeleton, reference), posed(plain)
    for bone in ("left_hand", "right_hand", "left_foot", "right_foot", "left_lower_leg"):
        assert np.allclose(there[bone], here[bone], atol=0.05)


def test_a_skeleton_without_legs_is_refused():
    skeleton = Skeleton(("Hips", "Spine"), np.array([-1, 0], np.int32), np.array([[0, 1, 0], [0, 0.3, 0.0]]))
    with pytest.raises(SixpointError, match="no leg from hip to ankle"):
        bind_pose(skeleton)
