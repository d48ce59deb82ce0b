import numpy as np
import pytest

from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.belief import Belief
from reconstruction.kinematics import world_joints
from reconstruction.relocalisation import Finding, Relocaliser, TrackerHistory
from reconstruction.rivals import Rivals
from reconstruction.rotations import wrapped
from reconstruction.solver import Reconstructor
from reconstruction.solver_settings import SolverSettings
from reconstruction.tracker_matching import Matches, Sighting, TrackerMatcher
from tests.reconstruction.conftest import strolling

UNSEEN = strolling(seed=31)


def frames(trackers: int = 6) -> list[TrackerFrame]:
    positions = world_joints(UNSEEN.skeleton, UNSEEN.root_positions, UNSEEN.rotations)[0]
    joints = [UNSEEN.skeleton.role_joint(role) for role in ROLES[:trackers]]
    return [
        TrackerFrame.from_positions(t / 60, dict(zip(ROLES, now[joints], strict=False)))
        for t, now in enumerate(positions)
    ]


def match(row: int, yaw: float) -> Matches:
    return Matches(np.array([row]), np.zeros(1), np.array([0.0, 0.0, yaw]))


def off_m(solver: Reconstructor, frame: int) -> float:
    pose = solver.solve(frames()[frame]).pose
    here, _ = world_joints(UNSEEN.skeleton, pose.root_position, pose.rotations)
    true, _ = world_joints(UNSEEN.skeleton, UNSEEN.root_positions[frame], UNSEEN.rotations[frame])
    return float(np.linalg.norm(here - true, axis=1).mean())


def test_a_belief_costs_what_its_last_frames_cost(database):
    belief = Belief()
    assert belief.cost == np.inf
    for cost in range(10):
        belief.add(None, float(cost), 2.0)  # type: ignore[arg-type]
    assert belief.implausibility == np.mean(range(5, 10))
    assert belief.cost == belief.implausibility + 2
    assert belief.age == 10


def test_only_other_facings_are_proposed_and_each_is_tried_once(database):
    rivals = Rivals(TrackerMatcher(database))
    history = TrackerHistory()
    for frame in frames()[:40]:
        history.add(frame.positions)
    nothing = Sighting(np.zeros(0, np.int64), np.zeros((0, 6, 3)))
    found = Finding(nothing, match(100, 0.1), (match(100, 0.1), match(230, 2.0), match(420, -3.0)))
    rivals.propose(found, facing=0.0)
    tried = []
    assert not rivals.wanted
    for _ in range(2):
        rival = rivals.rival(history, 1.0, lambda at: tried.append(int(at.rows[0])) or Belief())
        assert rival is not None
        while rivals.judged(rival, limit=1.0) is None and rival.age < Belief.TRIAL:
            rival.add(None, 1.0, 1.0)  # type: ignore[arg-type]
    for pause in (Rivals.PAUSE, 2 * Rivals.PAUSE):
        for _ in range(pause):
            assert not rivals.wanted
            assert rivals.rival(history, 1.0, lambda at: Belief()) is None
        assert rivals.wanted
        rivals.propose(found, facing=0.0)
        for _ in range(2):
            rival = rivals.rival(history, 1.0, lambda at: Belief())
            assert rival is not None
            for _ in range(Belief.TRIAL):
                rival.add(None, 1.0, 1.0)  # type: ignore[arg-type]
            assert rivals.judged(rival, limit=1.0) is None
    since = [row - first for row, first in zip(tried, (230, 420), strict=True)]
    assert since[0] == 1
    assert since[1] > since[0]


def test_a_pass_with_pauses_finds_where_the_trackers_are_by_now(database, monkeypatch):
    monkeypatch.setattr(Relocaliser, "ROWS_A_FRAME", len(database) // 4)
    relocaliser, history = Relocaliser(TrackerMatcher(database)), TrackerHistory()
    motion = strolling(seed=0)
    joints = [motion.skeleton.role_joint(role) for role in ROLES]
    found = []
    for row, now in enumerate(world_joints(motion.skeleton, motion.root_positions, motion.rotations)[0][:, joints]):
        history.add(now)
        if row >= 40 and row % 7 == 0:
            found.append((row, relocaliser.look(history, 1.0)))
    row, first = next((row, finding) for row, finding in found if finding is not None)
    assert row > 40 + 2 * 7
    assert first.best.rows[0] == row


@pytest.mark.parametrize(("cost", "wins"), [(0.5, True), (2.0, False)])
def test_a_rival_wins_by_its_cost_when_its_trial_is_over(database, cost, wins):
    rivals, rival = Rivals(TrackerMatcher(database)), Belief()
    for age in range(Belief.TRIAL):
        assert rival.age == age
        assert rivals.judged(rival, 1.0) is None
        rival.add(None, cost, 0.0)  # type: ignore[arg-type]
    assert rivals.judged(rival, 1.0) is (rival if wins else None)


def test_a_body_taken_for_facing_backwards_is_turned_round_with_all_trackers_on(database, monkeypatch):
    errors = {}
    for relocalise in (True, False):
        solver = Reconstructor(database, settings=SolverSettings(relocalise=relocalise))
        best = solver._matcher.best_of_all
        monkeypatch.setattr(solver._matcher, "best_of_all", lambda sighting, best=best: turned_round(best(sighting)))
        solver.start(frames()[:1])
        errors[relocalise] = [off_m(solver, frame) for frame in range(len(UNSEEN))]
    assert errors[True][-1] < 0.02
    assert errors[True][-1] <= errors[False][-1]


@pytest.mark.parametrize("lost", [True, False])
def test_a_take_that_is_lost_from_its_start_begins_with_the_facing_that_costs_least(database, monkeypatch, lost):
    solver = Reconstructor(database)
    best = solver._matcher.best_of_all
    true = solver.space.heading(UNSEEN.root_positions[:1], UNSEEN.rotations[:1, 0])[0, 2]

    def trial(found: Matches, _: list[TrackerFrame]) -> tuple[Belief, float]:
        belief = Belief()
        belief.add(None, float(np.abs(wrapped(found.heading[2] - true))), 0.0)  # type: ignore[arg-type]
        return belief, np.inf

    monkeypatch.setattr(solver._matcher, "best_of_all", lambda sighting: turned_round(best(sighting)))
    monkeypatch.setattr(solver, "_lost", lambda belief, coverage: lost)
    monkeypatch.setattr(solver, "_trial", trial)
    solver.start(frames()[:31])
    off = np.abs(wrapped(solver._belief.past[-1].heading[2] - true))
    assert off < 0.3 if lost else off > 2


def turned_round(found: Matches) -> Matches:
    return Matches(found.rows, found.errors, found.heading + np.array([0.0, 0.0, np.pi]))
