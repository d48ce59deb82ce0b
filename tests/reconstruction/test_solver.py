from dataclasses import replace

import numpy as np
import pytest

from devices.errors import SettingError
from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.database import build_database
from reconstruction.kinematics import world_joints
from reconstruction.rotations import exponential, multiply
from reconstruction.session_memory import SessionMemory
from reconstruction.skeleton import Skeleton
from reconstruction.solution import Reconstruction
from reconstruction.solver import Reconstructor, calibration, reconstruct
from reconstruction.solver_settings import SolverSettings
from reconstruction.tracking import Footing
from tests.reconstruction.conftest import strolling


def frames_of(motion, roles=ROLES, gaps=(), noise_m=0.0, seed=0) -> list[TrackerFrame]:
    """What trackers on the body would read; gaps: (role, first frame, last frame)."""
    joints, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    rng = np.random.default_rng(seed)
    frames = []
    for number, now in enumerate(joints):
        seen = {
            role: now[motion.skeleton.role_joint(role)] + rng.normal(0, noise_m, 3)
            for role in roles
            if not any(role == lost and first <= number < end for lost, first, end in gaps)
        }
        frames.append(TrackerFrame.from_positions(number / 60, seen))
    return frames


def errors_cm(true, found) -> np.ndarray:
    """(T, J) centimetres."""
    a, _ = world_joints(true.skeleton, true.root_positions, true.rotations)
    b, _ = world_joints(found.skeleton, found.root_positions, found.rotations)
    return 100 * np.linalg.norm(a - b, axis=-1)


UNSEEN = strolling(50, 120)


@pytest.mark.parametrize(("roles", "limit_cm"), [(ROLES, 1.0), (ROLES[2:], 2.5), (ROLES[3:], 6.0)])
def test_an_unseen_motion_is_reconstructed_from_its_first_frame_on(database, roles, limit_cm):
    found = reconstruct(frames_of(UNSEEN, roles), database)
    error = errors_cm(UNSEEN, found.motion)
    assert len(found.motion) == len(UNSEEN)
    assert error.mean() < limit_cm
    assert error[0].mean() < 3 * limit_cm


def test_two_trackers_give_a_pose_that_holds_them(database):
    roles = ("left_wrist", "right_ankle")
    found = reconstruct(frames_of(UNSEEN, roles), database, settings=SolverSettings(relocalise=False))
    held = [UNSEEN.skeleton.role_joint(role) for role in roles]
    assert errors_cm(UNSEEN, found.motion)[:, held].max() < 0.5


@pytest.mark.parametrize("relocalise", [True, False])
def test_a_wrong_belief_is_given_up(database, relocalise):
    frames = frames_of(UNSEEN, ROLES[3:])
    turned = [TrackerFrame(f.time_s, f.positions * [-1, 1, -1], f.orientations, f.states) for f in frames]
    solver = Reconstructor(database, settings=SolverSettings(relocalise=relocalise))
    solver.start(turned[:31])
    solved = Reconstruction.of([solver.solve(frame) for frame in frames], UNSEEN.skeleton, 60.0)
    error = errors_cm(UNSEEN, solved.motion).mean(axis=1)
    assert error[0] > 10
    assert error[-1] < 6


def test_solving_twice_gives_the_same_bits(database):
    frames = frames_of(UNSEEN)[:40]
    one, two = reconstruct(frames, database), reconstruct(frames, database)
    assert one.motion.rotations.tobytes() == two.motion.rotations.tobytes()
    assert one.motion.root_positions.tobytes() == two.motion.root_positions.tobytes()


def test_where_and_which_way_the_world_lies_does_not_matter(database):
    frames = frames_of(UNSEEN)[:60]
    moved = [
        TrackerFrame(f.time_s, f.positions[:, [2, 1, 0]] * [1, 1, -1] + [3.0, 0, 8.0], f.orientations, f.states)
        for f in frames
    ]
    a = reconstruct(frames, database).motion.root_positions
    b = reconstruct(moved, database).motion.root_positions
    np.testing.assert_allclose(a[:, [2, 1, 0]] * [1, 1, -1] + [3.0, 0, 8.0], b, atol=2e-3)


def test_one_wrist_lost_for_a_second_comes_back_without_a_jump(database):
    gap = ("left_wrist", 30, 90)
    found = reconstruct(frames_of(UNSEEN, gaps=[gap]), database)
    whole = reconstruct(frames_of(UNSEEN), database)
    wrist = UNSEEN.skeleton.role_joint("left_wrist")
    assert errors_cm(UNSEEN, found.motion)[30:90, wrist].mean() < 6
    others = [UNSEEN.skeleton.role_joint(role) for role in ROLES if role != "left_wrist"]
    assert errors_cm(UNSEEN, found.motion)[:, others].max() < 1.5
    joints = [
        world_joints(m.skeleton, m.root_positions, m.rotations)[0][:, wrist] for m in (found.motion, whole.motion)
    ]
    with_gap, without = (np.linalg.norm(np.diff(p, 2, axis=0), axis=-1) for p in joints)
    assert with_gap[88:115].max() < 2 * np.percentile(without, 99)
    assert set(found.states[30:90, ROLES.index("left_wrist")]) == {Footing.PRIOR}
    assert set(found.states[:30].ravel()) == {Footing.MEASURED}


def test_a_lost_wrist_goes_on_as_it_did_in_this_session(database, monkeypatch):
    fore = UNSEEN.skeleton.names.index("LeftForeArm")
    bent = multiply(UNSEEN.rotations[:, fore], exponential(np.array([0.5, 0.0, 0.5])))
    rotations = UNSEEN.rotations.copy()
    rotations[:, fore] = bent
    unusual = replace(UNSEEN, rotations=rotations)
    frames, wrist = frames_of(unusual, gaps=[("left_wrist", 55, 115)]), UNSEEN.skeleton.role_joint("left_wrist")
    remembering = reconstruct(frames, database)
    monkeypatch.setattr(SessionMemory, "FEWEST", 1000)
    forgetful = reconstruct(frames, database)
    np.testing.assert_array_equal(remembering.motion.rotations[:55], forgetful.motion.rotations[:55])
    with_memory, without = (
        errors_cm(unusual, found.motion)[55:115, wrist].mean() for found in (remembering, forgetful)
    )
    assert with_memory < 0.7 * without


def test_trackers_that_are_not_where_the_neighbours_expect_them_make_it_less_sure(database):
    frames = frames_of(UNSEEN)[:60]
    shift = np.random.default_rng(0).normal(0, 0.05, (6, 3))
    shifted = [replace(f, positions=f.positions + shift) for f in frames]
    usual, surprised = (reconstruct(f, database).sigma[20:] for f in (frames, shifted))
    assert surprised.mean() > 2 * usual.mean()
    assert calibration(0.1, 6, 0.002) < calibration(0.2, 6, 0.002) < calibration(0.2, 3, 0.002)
    assert calibration(0.1, 6, 0.002) < calibration(0.1, 6, 0.02)


def test_uncertainty_is_greater_while_a_tracker_is_lost_and_grows_while_the_pose_is_held(database):
    arm = UNSEEN.skeleton.names.index("LeftForeArm")
    lost = reconstruct(frames_of(UNSEEN, gaps=[("left_wrist", 40, 100)]), database).sigma[:, arm]
    whole = reconstruct(frames_of(UNSEEN), database).sigma[:, arm]
    np.testing.assert_array_equal(lost[:40], whole[:40])
    assert (lost[41:55] > whole[41:55]).all()
    assert lost[41:100].mean() > 1.2 * whole[41:100].mean()
    held = reconstruct(frames_of(UNSEEN, gaps=[(role, 20, 100) for role in ROLES]), database).sigma
    assert (held[95] > held[60])[held[60] > 0].all()


def test_with_every_tracker_gone_the_pose_goes_on_then_is_held_then_comes_back(database):
    gaps = [(role, 20, 80) for role in ROLES]
    found = reconstruct(frames_of(UNSEEN, gaps=gaps), database)
    assert np.isfinite(found.motion.rotations).all()
    assert (found.states[25] == Footing.PRIOR).all()
    assert (found.states[70] == Footing.HELD).all()
    np.testing.assert_array_equal(found.motion.rotations[65], found.motion.rotations[75])
    assert errors_cm(UNSEEN, found.motion)[-5:].mean() < 2


def test_before_any_tracker_is_seen_there_is_a_pose_and_no_certainty(database):
    solver = Reconstructor(database)
    solution = solver.solve(TrackerFrame.from_positions(0.0, {}))
    assert np.isfinite(solution.pose.rotations).all()
    assert (solution.states == Footing.HELD).all()
    assert solution.sigma.min() > 1
    later = [solver.solve(frame) for frame in frames_of(UNSEEN)[:30]]
    joints, _ = world_joints(solver.skeleton, later[-1].pose.root_position, later[-1].pose.rotations)
    true, _ = world_joints(UNSEEN.skeleton, UNSEEN.root_positions[29], UNSEEN.rotations[29])
    assert np.linalg.norm(joints - true, axis=1).mean() < 0.02


def test_the_number_of_trackers_may_change_at_any_frame(database):
    rng = np.random.default_rng(4)
    gaps = [(ROLES[rng.integers(6)], int(first), int(first) + 7) for first in rng.integers(0, 110, 60)]
    found = reconstruct(frames_of(UNSEEN, gaps=gaps), database)
    assert np.isfinite(found.motion.rotations).all()
    assert errors_cm(UNSEEN, found.motion).mean() < 6


def test_trackers_that_jump_about_never_break_it(database):
    rng = np.random.default_rng(1)
    frames = [TrackerFrame.from_positions(n / 60, {role: rng.normal(0, 30, 3) for role in ROLES}) for n in range(40)]
    found = reconstruct(frames, database)
    assert np.isfinite(found.motion.rotations).all()
    assert np.isfinite(found.motion.root_positions).all()
    assert found.coverage[5:].min() > 5


def test_noise_is_measured_and_smoothed(database):
    noisy = reconstruct(frames_of(UNSEEN, noise_m=0.005), database).motion
    assert errors_cm(UNSEEN, noisy).mean() < 1.5
    wrist = UNSEEN.skeleton.role_joint("left_wrist")
    tracked = np.array([f.positions[2] for f in frames_of(UNSEEN, noise_m=0.005)])
    solved = world_joints(noisy.skeleton, noisy.root_positions, noisy.rotations)[0][:, wrist]
    shake = [np.linalg.norm(np.diff(p[30:], 3, axis=0), axis=-1).mean() for p in (solved, tracked)]
    assert shake[0] < 0.6 * shake[1]


def test_a_body_of_another_size_is_solved_on_its_own_skeleton(database):
    tall = strolling(50, 90, stature_m=1.95)
    found = Reconstructor(database, tall.skeleton)
    poses = [found.solve(frame).pose for frame in frames_of(tall)]
    joints = np.array([world_joints(tall.skeleton, p.root_position, p.rotations)[0] for p in poses])
    true, _ = world_joints(tall.skeleton, tall.root_positions, tall.rotations)
    assert np.linalg.norm(joints - true, axis=-1)[15:].mean() < 0.015


def test_other_joints_and_empty_takes_are_refused(database):
    skeleton = database.space.skeleton
    renamed = Skeleton((*skeleton.names[:-1], "Tail"), skeleton.parents, skeleton.offsets)
    with pytest.raises(SettingError, match="other joints"):
        Reconstructor(database, renamed)
    with pytest.raises(SettingError, match="without frames"):
        reconstruct([], database)


def test_a_database_of_one_short_clip_is_enough_to_run(tmp_path):
    tiny = build_database([strolling(0, 5)], tmp_path / "tiny")
    found = reconstruct(frames_of(strolling(0, 30)), tiny)
    assert np.isfinite(found.motion.rotations).all()
