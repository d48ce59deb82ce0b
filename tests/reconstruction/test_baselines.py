from collections.abc import Sequence

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from capture.accuracy import accuracy
from capture.evaluation_runs import TRACKER_SETS, tracker_frames
from devices.sample import ROLES
from reconstruction.baselines import BASELINES
from reconstruction.baselines.gplvm import learned, objective, spread_out
from reconstruction.baselines.neighbourhood import NeighbourhoodFinder, own_history
from reconstruction.baselines.tracker_poses import TrackerPosePredictor
from reconstruction.body_kinematics import Body, joint_positions
from reconstruction.database import MotionDatabase
from reconstruction.default_predictor import DefaultPredictor, NeighbourSettings
from reconstruction.local_model import LocalModelSettings
from reconstruction.prediction import Observation, SolvedPose
from reconstruction.solver import reconstruct
from tests.reconstruction.conftest import strolling

SPAN = 3


def moment(database: MotionDatabase, row: int) -> tuple[list[SolvedPose], np.ndarray, np.ndarray]:
    """The past of a row, its trackers and its pose, both seen from the heading frame one row before."""
    from reconstruction.gathering import gather
    from reconstruction.window_features import seen_from

    body = Body.of(database.space)
    poses, headings = np.asarray(database.poses), np.asarray(database.headings, float)
    rows = np.arange(row - SPAN, row)
    joints = joint_positions(body, poses[rows].astype(float))
    none, unturned = np.zeros((6, 3)), np.tile(np.eye(3), (6, 1, 1))
    past = [
        SolvedPose(poses[r].astype(float), headings[r], j, none, unturned) for r, j in zip(rows, joints, strict=True)
    ]
    trackers = seen_from(np.asarray(database.tracks[row], float)[None], headings[row][None], headings[row - 1][None])[0]
    return past, trackers, gather(np.array([row]), 0, poses, np.asarray(database.headings))[0]


def predictors(database: MotionDatabase, roles: Sequence[str] = ROLES):
    return {name: make(database, 1.0, roles) for name, make in BASELINES.items()}


@pytest.fixture(scope="module")
def all_six(database: MotionDatabase):
    return predictors(database)


@pytest.mark.parametrize("name", BASELINES)
def test_a_prior_is_a_proper_gaussian(name: str, database: MotionDatabase, all_six) -> None:
    past, trackers, _ = moment(database, 400)
    prior = all_six[name].predict(past, Observation(trackers)).prior
    assert prior.mean.shape == (database.space.dof,)
    assert np.allclose(prior.precision, prior.precision.T)
    assert np.linalg.eigvalsh(prior.precision).min() > 0


@pytest.mark.parametrize("name", ["lpca", "lpcr", "nearest", "mean-16", "mean-16-ik"])
def test_inside_the_data_the_prior_is_near_the_truth(name: str, database: MotionDatabase, all_six) -> None:
    off = []
    for row in range(380, 460, 10):
        past, trackers, truth = moment(database, row)
        off.append(np.abs(all_six[name].predict(past, Observation(trackers)).prior.mean - truth).mean())
    assert np.mean(off) < 0.06


def test_a_pose_of_the_database_is_its_own_nearest(database: MotionDatabase, all_six) -> None:
    past, trackers, truth = moment(database, 400)
    found = all_six["nearest"].predict(past, Observation(trackers))
    assert found.rows[0] == 400
    assert np.allclose(found.prior.mean, truth, atol=1e-4)


def test_the_pose_is_laid_onto_the_trackers(database: MotionDatabase) -> None:
    past, trackers, _ = moment(database, 400)
    predictor = TrackerPosePredictor(database, 1.0, ROLES, count=16)
    here = predictor.predict(past, Observation(trackers)).prior.mean
    joints = [database.space.skeleton.role_joint(role) for role in ROLES]
    placed = joint_positions(Body.of(database.space), here[None])[0, joints]
    assert np.allclose(placed.mean(axis=0), trackers.mean(axis=0), atol=1e-6)


def test_the_neighbours_are_those_of_our_own_method(database: MotionDatabase) -> None:
    past, trackers, _ = moment(database, 400)
    ours = DefaultPredictor(database, 1.0, NeighbourSettings(), LocalModelSettings()).predict(
        past, Observation(trackers)
    )
    near = NeighbourhoodFinder(database, 1.0).find(past, trackers)
    assert np.array_equal(near.rows, ours.rows)
    assert near.weights.sum() == pytest.approx(1.0)
    assert near.histories.shape == (len(near.rows), SPAN * database.space.dof)


def test_a_row_is_found_with_its_own_history(database: MotionDatabase) -> None:
    past, trackers, truth = moment(database, 400)
    near = NeighbourhoodFinder(database, 1.0).find(past, trackers)
    place = int(np.flatnonzero(near.rows == 400)[0])
    assert np.allclose(near.histories[place], own_history(past), atol=1e-4)
    assert np.allclose(near.following[place], truth, atol=1e-4)


@pytest.mark.parametrize("count", TRACKER_SETS)
def test_every_tracker_set_is_solved(count: int, database: MotionDatabase) -> None:
    truth = strolling(seed=31, frames=40)
    frames = tracker_frames(truth, TRACKER_SETS[count])
    for name in ("mean-16-ik", "lpcr"):
        predictor = BASELINES[name](database, 1.0, TRACKER_SETS[count])
        solved = reconstruct(frames, database, truth.skeleton, predictor=predictor)
        assert np.isfinite(solved.motion.root_positions).all()
        assert np.isfinite(solved.motion.rotations).all()


@pytest.mark.parametrize("name", BASELINES)
def test_with_six_trackers_the_tracked_joints_follow(name: str, database: MotionDatabase, all_six) -> None:
    truth = strolling(seed=31, frames=60)
    solved = reconstruct(tracker_frames(truth, ROLES), database, truth.skeleton, predictor=all_six[name])
    looked_up_only = name in ("nearest", "mean-16")
    assert accuracy(truth, solved.motion).tracked_cm < (12.0 if looked_up_only else 1.0)


def test_the_latent_models_gradient_is_that_of_its_objective() -> None:
    rng = np.random.default_rng(5)
    scaled = rng.normal(size=(7, 4))
    packed = np.concatenate([rng.normal(size=14), np.log([0.8, 50.0, 1.3])])
    numeric = approx_fprime(packed, lambda p: objective(p, scaled, 2)[0], 1e-6)
    assert np.allclose(objective(packed, scaled, 2)[1], numeric, rtol=1e-4, atol=1e-3)


def test_the_latent_model_gives_back_what_it_learned() -> None:
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    poses = np.stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(2 * angle), np.sin(angle) - 0.2], axis=1)
    model = learned(poses, latent_dimensions=2)
    found = np.array([model.pose(x)[0] for x in model.latents])
    assert np.abs(found - poses).max() < 0.05
    at_data, far_away = model.pose(model.latents[0])[1], model.pose(model.latents[0] + 50)[1]
    assert at_data < 0.1 * far_away


def test_the_active_set_is_spread_out() -> None:
    crowd = np.concatenate([np.random.default_rng(0).normal(0, 0.01, (200, 2)), [[5, 0], [0, 5], [-5, 0]]])
    chosen = spread_out(crowd, 4)
    assert {200, 201, 202} < set(chosen.tolist())
    assert len(spread_out(crowd[:3], 10)) == 3
