"""Whole transitions, by what must hold for every pair, frame and method."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.errors import SettingError
from reconstruction.motion import Motion
from reconstruction.motion_operations import cropped, resampled
from reconstruction.skeleton import Skeleton
from reconstruction.transition import (
    METHODS,
    Cue,
    TransitionClip,
    joined,
    prepared,
    ready_pair,
    sequence,
    transition,
)
from reconstruction.transition.clip import angular_accelerations
from reconstruction.transition.measures import ankle_rest, own_slide, seam_figures
from reconstruction.transition.timing import DEFAULT_BOUNDS

from .moving_bodies import jumping, standing, walking

CLIPS = {"standing": standing(90), "arms up": standing(90, arms=-1.0), "walking": walking(120), "jumping": jumping()}
PREPARED = {name: prepared(motion) for name, motion in CLIPS.items()}
pairs = st.tuples(st.sampled_from(sorted(CLIPS)), st.sampled_from(sorted(CLIPS)))


def seam_of(a: TransitionClip, at: int, b: TransitionClip, method: str = "natural") -> tuple[Motion, int, int]:
    """The joined motion, and its frames left and entered."""
    step = transition(a, at, b, 0, method)
    motion = joined(a, at, step, b, 0)
    return motion, at, at + len(step.between) + 1


@given(pairs, st.integers(0, 89))
@settings(max_examples=25, deadline=None)
def test_the_clips_themselves_are_kept_and_the_next_one_only_placed(names: tuple[str, str], at: int) -> None:
    a, b = (PREPARED[name] for name in names)
    for method in ("natural", "paper"):
        step = transition(a, at, b, 0, method)
        motion = joined(a, at, step, b, 0)
        entered = at + len(step.between) + 1
        assert len(motion) == entered + len(b)
        np.testing.assert_array_equal(motion.root_positions[: at + 1], a.motion.root_positions[: at + 1])
        same = np.abs(np.sum(motion.rotations[entered:, 1:] * b.motion.rotations[:, 1:], axis=-1))
        np.testing.assert_allclose(same, 1, atol=1e-9)
        np.testing.assert_allclose(motion.root_positions[entered:], step.placement.points(b.motion.root_positions))
        assert step.duration_s == pytest.approx((len(step.between) + 1) / a.fps)
        assert step.duration_s <= DEFAULT_BOUNDS.longest_s + 1.3


@given(pairs, st.integers(5, 85))
@settings(max_examples=25, deadline=None)
def test_natural_transitions_are_smooth_and_stay_above_the_floor(names: tuple[str, str], at: int) -> None:
    a, b = (PREPARED[name] for name in names)
    motion, left, entered = seam_of(a, at, b)
    figures = seam_figures(motion, left, entered, a.floor_m, ankle_rest(a))
    assert figures.penetration_m < 0.005
    direct = seam_figures(*seam_of(a, at, b, "switch"), a.floor_m, ankle_rest(a))
    steps = np.linalg.norm(np.diff(motion.root_positions[left : entered + 1], axis=0), axis=-1)
    assert steps.max() * a.fps < 4
    # The made-up jump leaves the ground at full speed from one frame to the next: no seam there can be smooth.
    if names[0] not in ("jumping", names[1]):
        assert figures.peak_acceleration < max(0.5 * direct.peak_acceleration, 40)


def test_planted_feet_stand_while_the_arms_move() -> None:
    motion, left, entered = seam_of(PREPARED["standing"], 40, PREPARED["arms up"])
    figures = seam_figures(motion, left, entered, 0.0, ankle_rest(PREPARED["standing"]))
    assert figures.slide_m_s < 0.01


def test_walking_to_a_stand_does_not_skate() -> None:
    a, b = PREPARED["walking"], PREPARED["standing"]
    for at in range(20, 100, 8):
        motion, left, entered = seam_of(a, at, b)
        ours = seam_figures(motion, left, entered, a.floor_m, ankle_rest(b))
        paper = seam_figures(*seam_of(a, at, b, "paper"), a.floor_m, ankle_rest(b))
        assert ours.slide_m_s < max(own_slide(a), 0.6 * paper.slide_m_s)


def test_identical_poses_take_the_shortest_time_and_stay() -> None:
    clip = PREPARED["standing"]
    still = prepared(replace(clip.motion, rotations=np.repeat(clip.motion.rotations[:1], 90, axis=0),
                             root_positions=np.repeat(clip.motion.root_positions[:1], 90, axis=0)))  # fmt: skip
    step = transition(still, 30, still, 0)
    assert step.duration_s == pytest.approx(DEFAULT_BOUNDS.shortest_s, abs=1 / 60)
    np.testing.assert_allclose(step.between.root_positions[:, 1], still.motion.root_positions[0, 1], atol=1e-6)
    assert angular_accelerations(step.between.rotations, 60).max() < 0.5


def test_mid_flight_is_left_and_the_flight_lands() -> None:
    a, b = PREPARED["jumping"], PREPARED["walking"]
    for method in ("natural", "paper"):
        motion, left, entered = seam_of(a, 45, b, method)
        heights = motion.root_positions[left : entered + 1, 1]
        assert heights[0] > heights[-1] + 0.25
        assert np.abs(np.diff(heights)).max() < 0.12


@pytest.mark.parametrize("method", sorted(METHODS))
def test_single_frames_and_ends_of_clips_work(method: str) -> None:
    single = prepared(cropped(CLIPS["arms up"], 10, 11))
    whole = PREPARED["walking"]
    for a, at, b in ((single, 0, whole), (whole, len(whole) - 1, single), (single, 0, single), (whole, 0, whole)):
        step = transition(a, at, b, 0, method)
        motion = joined(a, at, step, b, 0)
        assert np.isfinite(motion.rotations).all()
        assert np.isfinite(motion.root_positions).all()
        np.testing.assert_allclose(np.linalg.norm(motion.rotations, axis=-1), 1, atol=1e-9)


def test_other_rates_and_proportions_are_fitted() -> None:
    a = PREPARED["walking"]
    b = prepared(resampled(standing(60, fps=100, stature_m=1.5), 100))
    ready = ready_pair(a, b)
    assert ready.fps == a.fps
    np.testing.assert_array_equal(ready.skeleton.offsets, a.skeleton.offsets)
    step = transition(a, 50, b)
    assert step.between.fps == a.fps
    assert np.isfinite(step.between.rotations).all()


def test_wrong_requests_say_what_would_be_right() -> None:
    a = PREPARED["walking"]
    bare = Skeleton(("Hips", "Tail"), np.array([-1, 0], np.int32), np.ones((2, 3)))
    other = prepared(Motion(bare, np.zeros((5, 3)), np.tile([0.0, 0, 0, 1], (5, 2, 1)), 60.0, "dog"))
    with pytest.raises(SettingError, match=r"'dog' is on another skeleton: it lacks Head.* and has besides Tail"):
        transition(a, 5, other)
    with pytest.raises(SettingError, match="left at frame 500: 'walking' has frames 0 to 119"):
        transition(a, 500, a)
    with pytest.raises(SettingError, match="use natural, paper"):
        transition(a, 5, a, method="magic")


def test_a_skeleton_without_legs_transits_too() -> None:
    skeleton = Skeleton(("a", "b", "b_end"), np.array([-1, 0, 1], np.int32), np.eye(3))
    turns = np.random.default_rng(1).normal(size=(20, 3, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    clip = prepared(Motion(skeleton, np.zeros((20, 3)), turns, 30.0))
    for method in METHODS:
        assert np.isfinite(transition(clip, 5, clip, 0, method).between.rotations).all()


def test_a_sequence_goes_on_where_each_clip_was_left() -> None:
    cues = [Cue(PREPARED["walking"], at=60), Cue(PREPARED["walking"], into=10, at=90), Cue(PREPARED["standing"])]
    motion, steps = sequence(cues)
    assert len(steps) == 2
    frames = 61 + len(steps[0].between) + 81 + len(steps[1].between) + 90
    assert len(motion) == frames
    jumps = np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=-1) * motion.fps
    assert jumps.max() < 3
    assert np.ptp(motion.root_positions[:, 2]) > 2
    with pytest.raises(SettingError, match="left at frame 5"):
        sequence([Cue(PREPARED["walking"], into=50, at=5), Cue(PREPARED["standing"])])
