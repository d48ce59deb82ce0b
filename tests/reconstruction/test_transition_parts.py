"""The pieces of a transition, each by the equation or law it stands for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.interpolation import slerp, squad, squad_control
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.rotations import exponential, inverse, logarithm, multiply
from reconstruction.standard_body import standard_skeleton
from reconstruction.transition import MotionClass, prepared
from reconstruction.transition.balance import support_excess
from reconstruction.transition.classification import classify, runs
from reconstruction.transition.clip import angular_derivatives
from reconstruction.transition.curves import (
    body_to_vector_rate,
    peak_acceleration,
    peak_acceleration_kernel,
    quintic_weights,
    quintic_weights_plain,
    turned_by,
    turned_by_kernel,
)
from reconstruction.transition.footwork import planned_steps
from reconstruction.transition.hierarchy import finger_joints, interpolated, interpolation_parameter
from reconstruction.transition.joint_limits import LEEWAY_RAD, keep_within_kernel, kept_within
from reconstruction.transition.leg_reach import reach_legs, reach_legs_kernel
from reconstruction.transition.rebasing import heading_at, placed_at
from reconstruction.transition.root_path import gravity_factor, with_gravity, with_trend
from reconstruction.transition.timing import joint_times
from reconstruction.transition.world_joints_kernel import joint_positions_kernel

from .moving_bodies import standing, walking

seeds = st.integers(0, 2**32 - 1)


def quaternions(rng: np.random.Generator, *shape: int) -> np.ndarray:
    q = rng.normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_slerp_turns_evenly_along_the_shortest_arc(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = quaternions(rng, 2)
    whole = np.linalg.norm(logarithm(multiply(inverse(a), b)))
    for h in (0.0, 0.3, 1.0):
        part = np.linalg.norm(logarithm(multiply(inverse(a), slerp(a, b, h))))
        assert part == pytest.approx(h * whole, abs=1e-6)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_squad_passes_its_keys_whatever_their_hemispheres(seed: int) -> None:
    rng = np.random.default_rng(seed)
    keys = multiply(quaternions(rng), exponential(rng.normal(0, 0.4, (4, 3))))
    signs = rng.choice([-1.0, 1.0], (4, 1))
    curve, other = (squad(*k, np.array(0.37)) for k in (keys, keys * signs))
    assert abs(np.sum(curve * other)) == pytest.approx(1)
    assert abs(np.sum(squad(*keys, np.array(0.0)) * keys[1])) == pytest.approx(1)
    assert abs(np.sum(squad(*keys, np.array(1.0)) * keys[2])) == pytest.approx(1)


def test_squad_control_of_an_even_turn_is_the_key_itself() -> None:
    keys = exponential(np.outer([-0.3, 0.0, 0.3], [0.6, 0.0, 0.8]))
    np.testing.assert_allclose(squad_control(*keys), keys[1], atol=1e-12)


def test_hierarchy_takes_squad_from_thirty_degrees_on_and_lerp_for_fingers() -> None:
    skeleton = standard_skeleton()
    left = np.tile([0.0, 0, 0, 1], (len(skeleton), 1))
    turn = np.zeros((len(skeleton), 3))
    turn[1, 0], turn[2, 0] = np.radians(31), np.radians(29)
    before = multiply(left, exponential(turn * 0 + [0, 0.2, 0]))
    entered = exponential(turn)
    result = interpolated(skeleton, before, left, entered, entered, np.array([0.25]))[0]
    np.testing.assert_allclose(result[2], slerp(left[2], entered[2], 0.25), atol=1e-12)
    np.testing.assert_allclose(result[1], squad(before[1], left[1], entered[1], entered[1], np.array(0.25)), atol=1e-12)
    assert np.linalg.norm(result[1] - slerp(left[1], entered[1], 0.25)) > 1e-3
    assert not finger_joints(skeleton).any()


def test_interpolation_parameters() -> None:
    s = np.linspace(0, 1, 11)
    spot, plane = MotionClass.ON_THE_SPOT, MotionClass.PLANE
    np.testing.assert_array_equal(interpolation_parameter(spot, spot, s), s)
    eased = interpolation_parameter(spot, plane, s)
    np.testing.assert_allclose(eased[[0, 5, 10]], [0, 0.5, 1])
    np.testing.assert_allclose(eased + eased[::-1], 1)
    assert eased[1] == pytest.approx(0.02)


def test_transition_time_is_angle_over_mean_speed_with_a_floor() -> None:
    turn = np.array([[1.0, 0, 0], [1.0, 0, 0], [0.0, 0, 0]])
    out, into = np.array([[3.0, 9, 0], [-3.0, 0, 0], [1, 1, 1]]), np.array([[1.0, 0, 0], [-1.0, 0, 0], [1, 1, 1]])
    times = joint_times(turn, out, into, np.array([0.5, 4.0, 1.0]))
    np.testing.assert_allclose(times, [2 * 1 / (3 + 1), 1 / 4, 0])


def test_root_paths() -> None:
    t = np.linspace(0, 0.8, 9)
    path = with_trend(np.zeros(3), np.array([1.0, 0, 2]), np.array([0, 0, -1.0]), t)
    np.testing.assert_allclose(path[-1], [0.8, 0, 1.6 - 0.32])
    k_g = gravity_factor(1.1, 2.0, 0.9, 0.8)
    flight = with_gravity(np.array([0, 1.1, 0]), np.array([0.5, 2.0, 0]), k_g, t)
    assert flight[-1, 1] == pytest.approx(0.9)
    assert flight[-1, 0] == pytest.approx(0.4)


def test_runs() -> None:
    assert runs(np.array([1, 1, 0, 1, 0, 0, 1], bool)) == [(0, 2), (3, 4), (6, 7)]
    assert runs(np.zeros(3, bool)) == []


def test_classes() -> None:
    t = np.arange(120) / 60
    feet = np.zeros((120, 2, 3))
    down, hips = np.zeros((120, 2)), np.full(120, 0.9)
    assert classify(feet, down, hips, 60) is MotionClass.ON_THE_SPOT
    away = feet + t[:, None, None] * (0, 0, 1)
    assert classify(away, down, hips, 60) is MotionClass.PLANE
    jump = np.maximum(0.4 - 5 * (t - 1) ** 2, 0)
    assert classify(feet, np.stack([jump, jump], 1), hips + jump, 60) is MotionClass.FLIGHT
    hop_of_a_run = np.maximum(0.1 - 5 * (t - 1) ** 2, 0)
    assert classify(away, np.stack([hop_of_a_run] * 2, 1), hips + hop_of_a_run, 60) is MotionClass.PLANE


def test_synthetic_clips_have_their_class() -> None:
    assert prepared(standing(60)).motion_class is MotionClass.ON_THE_SPOT
    assert prepared(walking(120)).motion_class is MotionClass.PLANE


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_quintics_meet_their_ends_and_kernels_their_plain_forms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    duration = float(rng.uniform(0.1, 2))
    t = np.linspace(-0.1, duration + 0.1, 50)
    np.testing.assert_allclose(quintic_weights(t, duration), quintic_weights_plain(t, duration), atol=1e-12)
    keys, step = rng.normal(size=6), 1e-4
    near = np.array([0, step, 2 * step])
    x0, x1, x2 = quintic_weights(near, duration) @ keys
    assert x0 == pytest.approx(keys[0])
    assert (x1 - x0) / step == pytest.approx(keys[1] + keys[2] * step / 2, abs=1e-3)
    assert (x2 - 2 * x1 + x0) / step**2 == pytest.approx(keys[2], rel=0.01, abs=30 * step * 60 / duration**3)
    y0, y1 = quintic_weights(np.array([duration - step, duration]), duration) @ keys
    assert y1 == pytest.approx(keys[3])
    assert (y1 - y0) / step == pytest.approx(keys[4] - keys[5] * step / 2, abs=1e-3)
    start, vectors = quaternions(rng, 5), rng.normal(0, 1, (7, 5, 3)) * rng.choice([1, 1e-6])
    turned = turned_by(start, vectors)
    np.testing.assert_allclose(turned_by_kernel(start, vectors), turned, atol=1e-12)
    assert peak_acceleration_kernel(turned, 30.0) == pytest.approx(peak_acceleration(turned, 30.0))


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_body_rates_become_rates_of_the_rotation_vector(seed: int) -> None:
    rng = np.random.default_rng(seed)
    phi, omega, step = rng.normal(0, 0.9, 3), rng.normal(0, 1, 3), 1e-6
    moved = logarithm(multiply(exponential(phi), exponential(omega * step)))
    if np.linalg.norm(phi) < 3:
        np.testing.assert_allclose((moved - phi) / step, body_to_vector_rate(phi, omega), atol=1e-4)


def test_derivatives_of_an_even_turn() -> None:
    t = np.arange(40) / 60
    rotations = exponential(np.outer(0.5 * 3.0 * t**2, [0, 0, 1.0]))[:, None]
    velocity, acceleration = angular_derivatives(rotations, 60)
    np.testing.assert_allclose(velocity[5:-5, 0, 2], 3 * t[5:-5], atol=1e-9)
    np.testing.assert_allclose(acceleration[5:-5, 0], np.tile([0, 0, 3.0], (30, 1)), atol=1e-6)


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_placement_puts_the_root_and_the_heading(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clip = prepared(walking(60))
    position, heading = rng.normal(0, 3, 3), float(rng.uniform(-3, 3))
    placement = placed_at(clip, 20, position, heading)
    moved = prepared(placement.motion(clip.motion))
    np.testing.assert_allclose(moved.motion.root_positions[20, [0, 2]], position[[0, 2]], atol=1e-9)
    assert moved.motion.root_positions[20, 1] == pytest.approx(clip.motion.root_positions[20, 1])
    assert heading_at(moved, 20) == pytest.approx(heading, abs=1e-9)


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_legs_reach_and_the_kernel_agrees(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clip = prepared(walking(60))
    frames = slice(10, 30)
    positions, rotations = clip.motion.root_positions[frames], clip.motion.rotations[frames].copy()
    ankles = clip.joints[frames][:, [leg.ankle for leg in clip.legs]] + rng.uniform(-0.08, 0.08, (20, 2, 3))
    feet = multiply(clip.world_rotations[frames][:, [leg.ankle for leg in clip.legs]], quaternions(rng))
    hinges = clip.hinges / np.linalg.norm(clip.hinges, axis=-1, keepdims=True)
    seam, soft_from = rng.uniform(0, 1, 20), rng.uniform(0.98, 0.99, 2)
    plain = reach_legs(clip.skeleton, clip.legs, positions, rotations, ankles, feet, hinges, seam * 0, soft_from)
    joints, _ = world_joints(clip.skeleton, positions, plain)
    length = sum(np.linalg.norm(clip.skeleton.offsets[j]) for j in (clip.legs[0].knee, clip.legs[0].ankle))
    for f, leg in enumerate(clip.legs):
        hip = joints[:, leg.hip]
        near = np.linalg.norm(ankles[:, f] - hip, axis=-1) < 0.98 * length
        np.testing.assert_allclose(joints[near, leg.ankle], ankles[near, f], atol=1e-3)
    plain = reach_legs(clip.skeleton, clip.legs, positions, rotations, ankles, feet, hinges, seam, soft_from)
    body = (clip.skeleton.parents, clip.skeleton.offsets, clip.leg_joints)
    reach_legs_kernel(*body, positions, rotations, ankles, feet, hinges, seam, soft_from)
    assert np.abs(np.sum(plain * rotations, axis=-1)).min() == pytest.approx(1, abs=1e-9)


def test_feet_take_turns() -> None:
    both, left = np.array([True, True]), np.array([True, False])
    gaps = np.array([0.3, 0.2])
    first, second = planned_steps(both, both, gaps, 1.0)
    assert first.land_s <= second.lift_s
    assert first.height_m > 0
    held, comes = planned_steps(left, both, np.array([0.0, 0.4]), 1.0)
    assert comes.lift_s == 0
    assert held.height_m == 0
    lands, goes = planned_steps(left, ~left, np.array([0.5, 0.4]), 1.0)[::-1]
    assert lands.land_s <= goes.lift_s


def test_a_motion_without_legs_is_on_the_spot() -> None:
    skeleton = standard_skeleton()
    names = tuple(f"joint{k}" for k in range(len(skeleton)))
    bare = type(skeleton)(names, skeleton.parents, skeleton.offsets)
    motion = standing(20)
    clip = prepared(Motion(bare, motion.root_positions, motion.rotations, motion.fps))
    assert clip.legs == ()
    assert clip.motion_class is MotionClass.ON_THE_SPOT


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_limits_are_kept_and_the_kernel_agrees(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotations = exponential(rng.normal(0, 0.7, (6, 4, 3))) * rng.choice([-1.0, 1.0], (6, 4, 1))
    low, high = -rng.uniform(0, 1, (4, 3)), rng.uniform(0, 1, (4, 3))
    plain = kept_within(rotations, low, high)
    vectors = logarithm(plain)
    assert (vectors <= high + LEEWAY_RAD + 1e-9).all()
    assert (vectors >= low - LEEWAY_RAD - 1e-9).all()
    compiled = rotations.copy()
    keep_within_kernel(compiled, low, high)
    np.testing.assert_allclose(np.abs(np.sum(compiled * plain, axis=-1)), 1, atol=1e-12)


def test_joint_positions_kernel_agrees() -> None:
    motion = walking(30)
    skeleton = motion.skeleton
    expected, _ = world_joints(skeleton, motion.root_positions, motion.rotations)
    positions, world = joint_positions_kernel(
        skeleton.parents, skeleton.offsets, motion.root_positions, motion.rotations
    )
    np.testing.assert_allclose(positions, expected, atol=1e-12)
    assert np.abs(np.sum(world * prepared(motion).world_rotations, axis=-1)).min() == pytest.approx(1)


def test_the_centre_of_mass_of_a_standing_body_is_at_its_hips() -> None:
    clip = prepared(standing(10))
    assert clip.mass_weights.sum() == pytest.approx(1)
    centre = np.einsum("j,tjk->tk", clip.mass_weights, clip.joints)
    hips = clip.motion.root_positions[:, 1]
    assert np.abs(centre[:, 0]).max() < 1e-9
    np.testing.assert_allclose(centre[:, 1] / hips, 1.05, atol=0.08)


def test_support_pulls_back_the_shortest_way() -> None:
    feet = np.tile([[[-0.1, 0, 0], [0.1, 0, 0]]], (3, 1, 1))
    centre = np.array([[0.0, 1, 0.3], [0.05, 1, 0.0], [0.3, 1, 0.0]])
    both, one = np.ones((3, 2), bool), np.tile([True, False], (3, 1))
    np.testing.assert_allclose(support_excess(centre, feet, both), [[0, -0.22], [0, 0], [-0.12, 0]], atol=1e-9)
    np.testing.assert_allclose(support_excess(centre, feet, one)[1], [-0.07, 0], atol=1e-9)
    np.testing.assert_array_equal(support_excess(centre, feet, ~both), np.zeros((3, 2)))
