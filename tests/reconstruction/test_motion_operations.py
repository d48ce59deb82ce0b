"""Whole-motion operations, by the laws they keep."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from devices.errors import SettingError
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_files import read_motion
from reconstruction.motion_operations import (
    concatenated,
    cropped,
    mirror_joints,
    mirrored,
    resampled,
    retargeted,
)
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

from .test_bvh import MOCAP, distance, random_motion

seeds = st.integers(0, 2**32 - 1)


def swaying(rng: np.random.Generator, skeleton: Skeleton, frames: int = 20) -> Motion:
    """A body that stands and sways: every joint turns a little, about means that differ from the rest pose."""
    wave = np.sin(np.linspace(0, 6, frames)[:, None, None] + rng.uniform(0, 6, (1, len(skeleton), 3)))
    turns = 0.25 * wave + rng.normal(0, 0.1, (1, len(skeleton), 3))
    turns[:, skeleton.is_end] = 0
    rotations = Rotation.from_rotvec(turns.reshape(-1, 3)).as_quat().reshape(frames, len(skeleton), 4)
    return Motion(skeleton, rng.normal(0, 0.1, (frames, 3)) + skeleton.offsets[0], rotations, 60.0)


def joints_of(motion: Motion) -> np.ndarray:
    return world_joints(motion.skeleton, motion.root_positions, motion.rotations)[0]


@given(seeds, st.sampled_from([24.0, 30.0, 59.94, 120.0]))
@settings(max_examples=15, deadline=None)
def test_resampling_is_slerp_at_even_times_to_the_end(seed: int, fps: float) -> None:
    motion = random_motion(np.random.default_rng(seed), 31)
    times = np.arange(0, motion.duration_s + 1e-9, 1 / fps)
    result = resampled(motion, fps)
    assert len(result) == len(times)
    assert result.fps == fps
    own = np.arange(len(motion)) / motion.fps
    for joint in (0, 5):
        expected = Slerp(own, Rotation.from_quat(motion.rotations[:, joint]))(np.minimum(times, own[-1])).as_quat()
        assert distance(result.rotations[:, joint], expected) < 1e-6
    expected_x = np.interp(times, own, motion.root_positions[:, 0])
    np.testing.assert_allclose(result.root_positions[:, 0], expected_x, atol=1e-9)


def test_resampling_twice_the_rate_and_back_changes_nothing() -> None:
    motion = random_motion(np.random.default_rng(1))
    back = resampled(resampled(motion, 120), 60)
    assert distance(back.rotations, motion.rotations) < 1e-7
    np.testing.assert_allclose(back.root_positions, motion.root_positions, atol=1e-12)


def test_resampling_needs_a_rate_and_takes_a_single_frame() -> None:
    motion = cropped(random_motion(np.random.default_rng(1)), 3, 4)
    assert len(resampled(motion, 30)) == 1
    with pytest.raises(SettingError, match="above zero"):
        resampled(motion, 0)


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_mirroring_mirrors_positions_and_twice_is_nothing(seed: int) -> None:
    motion = swaying(np.random.default_rng(seed), standard_skeleton())
    image = mirrored(motion)
    expected = joints_of(motion)[:, mirror_joints(motion.skeleton)] * (-1, 1, 1)
    np.testing.assert_allclose(joints_of(image), expected, atol=1e-12)
    assert distance(mirrored(image).rotations, motion.rotations) < 1e-12


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_mirroring_does_not_care_how_the_joints_own_axes_lie(seed: int) -> None:
    """The same body, its joints' axes turned by 90 degrees as Bandai Namco's are: left and right no mirror images."""
    rng = np.random.default_rng(seed)
    motion = swaying(rng, standard_skeleton())
    turns = Rotation.from_euler("ZX", rng.integers(0, 4, (len(motion.skeleton), 2)) * 90, degrees=True)
    counterpart = mirror_joints(motion.skeleton)
    for joint, other in enumerate(counterpart):
        if other > joint:  # the other side turned the same way, as if its axes were no mirror image
            turns[int(other)] = turns[joint]
    other_axes = with_axes_turned(motion, turns)
    np.testing.assert_allclose(joints_of(other_axes), joints_of(motion), atol=1e-12)
    expected = joints_of(motion)[:, counterpart] * (-1, 1, 1)
    np.testing.assert_allclose(joints_of(mirrored(other_axes)), expected, atol=1e-9)


def with_axes_turned(motion: Motion, turns: Rotation) -> Motion:
    """The same motion on joints whose own axes are turned: W'_j = W_j turns_j."""
    skeleton = motion.skeleton
    parents = [Rotation.identity() if p < 0 else turns[int(p)] for p in skeleton.parents]
    offsets = np.array([p.inv().apply(o) for p, o in zip(parents, skeleton.offsets, strict=True)])
    rotations = np.stack(
        [
            (parents[j].inv() * Rotation.from_quat(motion.rotations[:, j]) * turns[j]).as_quat()
            for j in range(len(skeleton))
        ],
        axis=1,
    )
    return Motion(Skeleton(skeleton.names, skeleton.parents, offsets), motion.root_positions, rotations, motion.fps)


def test_names_of_all_kinds_find_their_other_side() -> None:
    names = ("Hips", "LHipJoint", "RHipJoint", "Hand_L", "Hand_R", "mixamorig:LeftArm", "mixamorig:RightArm")
    names += ("lowerback", "lfemur", "rfemur", "LowerLeg_R", "LowerLeg_L", "clavicle.l", "clavicle.r")
    skeleton = Skeleton(names, np.array([-1] + [0] * (len(names) - 1), np.int32), np.zeros((len(names), 3)))
    pairs = {names[a]: names[b] for a, b in enumerate(mirror_joints(skeleton))}
    assert pairs["LHipJoint"] == "RHipJoint"
    assert pairs["Hand_R"] == "Hand_L"
    assert pairs["lowerback"] == "lowerback"
    assert pairs["mixamorig:LeftArm"] == "mixamorig:RightArm"
    assert pairs["lfemur"] == "rfemur"
    assert pairs["LowerLeg_L"] == "LowerLeg_R"
    assert pairs["clavicle.r"] == "clavicle.l"


def test_parts_and_sequences() -> None:
    motion = random_motion(np.random.default_rng(2))
    whole = concatenated([cropped(motion, 0, 5), cropped(motion, 5, len(motion))])
    assert distance(whole.rotations, motion.rotations) == 0
    with pytest.raises(SettingError, match="frames 5 to 99"):
        cropped(motion, 5, 99)
    with pytest.raises(SettingError, match="30 frames a second"):
        concatenated([motion, resampled(motion, 30)])


def test_retargeting_keeps_the_feet_on_the_floor_and_scales_the_stride() -> None:
    motion = swaying(np.random.default_rng(3), standard_skeleton(1.6))
    tall = retargeted(motion, standard_skeleton(1.92))
    floor = [np.percentile(joints_of(m)[..., 1].min(axis=1), 5) for m in (motion, tall)]
    assert floor[1] == pytest.approx(floor[0], abs=1e-9)
    travelled = [np.ptp(m.root_positions[:, 2]) for m in (motion, tall)]
    assert travelled[1] == pytest.approx(1.2 * travelled[0])
    np.testing.assert_array_equal(tall.rotations, motion.rotations)


def test_retargeting_finds_joints_by_name_and_refuses_other_skeletons() -> None:
    motion = swaying(np.random.default_rng(4), standard_skeleton())
    other = Skeleton(("Hips", "Tail"), np.array([-1, 0], np.int32), np.ones((2, 3)))
    with pytest.raises(SettingError, match=r"lacks Tail and has besides Head"):
        retargeted(motion, other)


@pytest.mark.skipif(not MOCAP.is_dir(), reason="shared motion capture is not beside the repository")
@pytest.mark.parametrize(
    ("name", "tolerance_m"),
    [("bandai1/dataset-1_walk_proud_001.bvh", 0.001), ("cmu/cmu_train_running_2.bvh", 0.03)],
)
def test_captured_motion_mirrors_as_far_as_the_body_is_symmetric(name: str, tolerance_m: float) -> None:
    motion = read_motion(MOCAP / name)
    image = mirrored(motion)
    expected = joints_of(motion)[:, mirror_joints(motion.skeleton)] * (-1, 1, 1)
    assert np.abs(joints_of(image) - expected).max() < tolerance_m
    assert distance(mirrored(image).rotations, motion.rotations) < 1e-6
