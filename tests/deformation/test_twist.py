import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from deformation.character import Character, LatticeSettings, make_character
from deformation.skinning import bind_points, blend, blend_reference, joint_motion
from deformation.twist import PLACES, twisted, twisted_reference
from reconstruction.skeleton import Skeleton
from tests.deformation.bodies import at, box


def forearm() -> Character:
    """A limb along +X whose last third is a hand."""
    positions = np.array([[0.0, 0, 0], [0.6, 0, 0], [0.9, 0, 0]])
    offsets = np.diff(positions, axis=0, prepend=np.zeros((1, 3)))
    skeleton = Skeleton(("LeftForeArm", "LeftHand", "LeftHand_end"), np.array([-1, 0, 1], np.int32), offsets)
    body = box((0, -0.08, -0.08), (0.9, 0.08, 0.08), 10)
    return make_character(body, skeleton, at(positions), settings=LatticeSettings(0.05))


ARM = forearm()
vectors = st.lists(st.floats(-2.5, 2.5), min_size=6, max_size=6).map(lambda v: np.reshape(v, (2, 3)))


def moved(turns: np.ndarray) -> np.ndarray:
    """(J, 3, 4) with the forearm, and the hand after it, turned by rotation vectors (2, 3) about their joints."""
    transforms = ARM.bind.copy()
    first, second = (Rotation.from_rotvec(turn).as_matrix() for turn in turns)
    transforms[0, :3, :3] = first
    transforms[1, :3, :3], transforms[1, :3, 3] = first @ second, first @ ARM.bind[1, :3, 3]
    transforms[2, :3, :3], transforms[2, :3, 3] = first @ second, first @ (ARM.bind[1, :3, 3] + second @ [0.3, 0, 0])
    return joint_motion(transforms, ARM.bind_inverse)


def skinned(motion: np.ndarray) -> np.ndarray:
    particles = np.empty_like(ARM.lattice.particles)
    blend(motion, ARM.binding, ARM.lattice.particles, particles, np.empty((len(particles), 3, 3)))
    return particles


@settings(deadline=None)
@given(vectors)
def test_the_kernels_are_their_references(turns: np.ndarray) -> None:
    motion = moved(turns)
    expected = twisted_reference(motion, ARM.binding.twists)
    np.testing.assert_allclose(twisted(motion, ARM.binding.twists), expected, atol=1e-9)
    positions, _ = blend_reference(motion, ARM.binding, ARM.lattice.particles)
    np.testing.assert_allclose(skinned(motion), positions, atol=1e-7)


@given(vectors, st.floats(-2.6, 2.6))
def test_a_bone_starts_as_its_own_joint_and_ends_as_its_childs_twist(turns: np.ndarray, twist: float) -> None:
    motion = moved(np.array([turns[0], [twist, 0, 0]]))
    levels = twisted(motion, ARM.binding.twists)
    np.testing.assert_allclose(levels[0, 0], motion[0], atol=1e-9)
    np.testing.assert_allclose(levels[0, -1], motion[1], atol=1e-9)
    halfway = motion[0, :, :3].T @ levels[0, PLACES // 2, :, :3]
    np.testing.assert_allclose(Rotation.from_matrix(halfway).as_rotvec(), [twist / 2, 0, 0], atol=1e-9)


def test_a_hand_that_only_swings_twists_nothing() -> None:
    motion = moved(np.array([[0.3, 0.2, 0.1], [0, 0.8, -0.5]]))
    levels = twisted(motion, ARM.binding.twists)
    turned = np.einsum("ji,pjl->pil", motion[0, :, :3], levels[0, :, :, :3])
    angles = Rotation.from_matrix(turned).magnitude()
    assert angles.max() < 1e-9


def test_a_twisted_forearm_keeps_its_girth_all_along() -> None:
    rest, now = ARM.lattice.particles, skinned(moved(np.array([[0, 0, 0], [2.6, 0, 0]])))
    girth, after = (np.linalg.norm(points[:, 1:], axis=1) for points in (rest, now))
    outer = girth > 0.05
    assert (after[outer] / girth[outer]).min() > 0.97
    turn = np.unwrap(np.arctan2(now[:, 2], now[:, 1]) - np.arctan2(rest[:, 2], rest[:, 1]))
    middle = outer & (np.abs(rest[:, 0] - 0.3) < 0.03)
    np.testing.assert_allclose(np.mod(turn[middle], 2 * np.pi), 1.3, atol=0.2)


@pytest.mark.parametrize("way", [1, -1])
def test_past_half_a_turn_nothing_jumps(way: int) -> None:
    before, after = (skinned(moved(np.array([[0, 0, 0], [way * (np.pi + step), 0, 0]]))) for step in (-1e-4, 1e-4))
    apart = np.linalg.norm(before - after, axis=1)
    shares = np.sort(ARM.binding.weights, axis=1)[:, -1]
    assert apart[shares > 0.75].max() < 1e-3


def test_without_points_no_bone_twists() -> None:
    binding = ARM.binding
    bare = bind_points(ARM.skeleton, ARM.bind[:, :3, 3], binding.joints, binding.weights)
    assert len(bare.twists.joints) == 0
    assert (bare.twists.bone == -1).all()
