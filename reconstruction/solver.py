"""From tracker frames to poses, one frame at a time: retrieve, build the problem, solve it, remember."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter_ns

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.errors import SettingError, choice_error
from devices.frame import TrackerFrame, frozen
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.belief import Belief
from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.database import MotionDatabase
from reconstruction.default_predictor import DefaultPredictor
from reconstruction.effectors import Measurement, and_lost, and_recalled, effectors
from reconstruction.gathering import see_from
from reconstruction.likelihood import Effectors
from reconstruction.map_problem import MapProblem
from reconstruction.map_solver import MapSolution, MapSolver
from reconstruction.motion import Pose
from reconstruction.motion_operations import leg_length
from reconstruction.mounting import Mounting
from reconstruction.paper_predictor import PaperPredictor
from reconstruction.pose_space import ROOT_DOF
from reconstruction.pose_statistics import PoseStatistics
from reconstruction.prediction import Observation, Prediction, Predictor, SolvedPose
from reconstruction.relocalisation import OFFSETS, Finding, Relocaliser, TrackerHistory
from reconstruction.rivals import Rivals
from reconstruction.rotations import about_up, inverse, logarithm, multiply
from reconstruction.session_memory import SessionMemory
from reconstruction.skeleton import Skeleton
from reconstruction.solution import Reconstruction, Solution
from reconstruction.solver_settings import METHODS, SolverSettings
from reconstruction.tracker_filter import TrackerFilter
from reconstruction.tracker_matching import Matches, Sighting, TrackerMatcher
from reconstruction.tracking import Footing, NoiseMeter, OrientationGate, PoseEasing, TrackerReturn, footings
from reconstruction.window_features import SPAN, seen_from

_WORLD = np.zeros(3)
"""The heading frame that stands at the world's origin."""


@dataclass(frozen=True, eq=False)
class _Explained:
    """One frame by one belief. heading: (3,) from where the problem and what was found are seen; measured: those of the
    problem's effectors that trackers stand for; moment: (2, 6, 3) the tracked joints, as `SessionMemory` takes them."""

    pose: Pose
    prediction: Prediction
    problem: MapProblem
    found: MapSolution
    heading: NDArray[np.float64]
    measured: Effectors
    moment: NDArray[np.float64]
    stage_ns: dict[str, int]


class Reconstructor:
    """Solves frames that come one database period apart, on a body with the database's joints.

    Everything is compiled and paged in when it stands: its first frame is as fast as any, but for the search of the
    whole database for a start.
    """

    FEW = 4
    """With more trackers than this the history cannot go astray."""
    STRAY_M_S = 0.3
    """How fast the place of a lost tracker grows uncertain."""
    FAR_M = 0.5
    """Trackers that are this far off after all were missing start anew."""
    LOST = 4.0
    """Coverage from which on other beliefs are tried where poses are implausible, ..."""
    CLEARLY = 0.6
    """... which win by a cost this much lower, as a ratio."""

    def __init__(
        self,
        database: MotionDatabase,
        skeleton: Skeleton | None = None,
        settings: SolverSettings | None = None,
        predictor: Predictor | None = None,
        mounting: Mounting | None = None,
    ):
        """skeleton: the performer's; the database's own where None. predictor: in place of the settings' method.
        mounting: how the trackers sit; in the joints where None.

        Raises SettingError where the skeleton's joints differ.
        """
        self.database = database
        self.mounting = mounting or Mounting.at_the_joints()
        self.settings = settings or SolverSettings()
        skeleton = skeleton or database.space.skeleton
        if not database.space.skeleton.same_tree(skeleton):
            raise SettingError("the performer's skeleton has other joints than the database's")
        self.space = database.space.with_skeleton(skeleton)
        self.scale = leg_length(skeleton) / leg_length(database.space.skeleton)
        self._body = Body.of(self.space)
        self._state = BodyState.of(len(skeleton))
        self.problem: MapProblem
        """The last frame's MAP problem, ..."""
        self.solved: NDArray[np.float64]
        """... and its solution (D,), seen from the same heading frame."""
        self._measured: Effectors
        self.map_solver = MapSolver(self._body, self.space.dof)
        self.role_joints = np.array([skeleton.role_joint(role) for role in ROLES], np.int64)
        self._poses, self._headings = np.asarray(database.poses), np.asarray(database.headings)
        self._lower, self._upper = np.asarray(database.bounds, np.float64).T.copy()
        self._lower[:ROOT_DOF], self._upper[:ROOT_DOF] = -np.inf, np.inf
        self._all_poses = PoseStatistics.of_database(database, self.scale)
        self._predictor = predictor or _predictor(database, self.scale, self.settings)
        self._matcher = TrackerMatcher(database)
        self._relocaliser = Relocaliser(self._matcher)
        self._return = TrackerReturn()
        self._easing = PoseEasing()
        self._gate = OrientationGate()
        self.reset()
        self._warm_up()

    @property
    def skeleton(self) -> Skeleton:
        """The performer's."""
        return self.space.skeleton

    def reset(self) -> None:
        """Forgets the past: the next frame starts anew."""
        self._belief = Belief()
        self._rivals = Rivals(self._matcher)
        self._trackers = TrackerHistory()
        self._noise = NoiseMeter()
        self._filter = TrackerFilter(self.database.fps)
        self._memory = SessionMemory()
        self._return.reset()
        self._easing.reset()
        self._gate.reset()
        self._relocaliser.reset()
        self._seen_s = np.full(len(ROLES), -np.inf)
        self._last: Solution | None = None

    def start(self, frames: Sequence[TrackerFrame]) -> None:
        """Finds where in the database a take begins, by the trackers of its first frame and, where there are more, of
        the half second after it. A session, which has only the first, may leave it to `solve`."""
        offsets = -OFFSETS[len(frames) > -OFFSETS]
        points = np.array([frames[offset].positions for offset in offsets]) / self.scale
        sighting = Sighting(offsets, points)
        matches = self._matcher.best_of_all(sighting)
        if not len(matches.rows):
            sighting = Sighting(offsets[:1], points[:1])
            matches = self._matcher.best_of_all(sighting)
        if len(frames) > Belief.TRIAL and self._lost_from(matches, frames):
            others = self._matcher.best_by_facing(sighting)
            matches = min((matches, *others), key=lambda found: self._trial(found, frames)[0].cost)
        self._belief = self._belief_in(matches, last=-1)
        self._rivals.reset()
        self._relocaliser.reset()

    def _lost_from(self, matches: Matches, frames: Sequence[TrackerFrame]) -> bool:
        """Whether many trackers lead away from all poses there are, when they are solved from the best match on."""
        return self._many(frames[0]) and self._lost(*self._trial(matches, frames))

    def _lost(self, belief: Belief, coverage: float) -> bool:
        """Whether a belief may be wrong as a whole: far from all neighbours, and a pose such as hardly any is."""
        return coverage > self.LOST and belief.implausibility > self.space.dof

    def _trial(self, matches: Matches, frames: Sequence[TrackerFrame]) -> tuple[Belief, float]:
        """The belief that a match leads to over a take's first frames, and the coverage there."""
        belief, coverage = self._belief_in(matches, last=-1), np.inf
        for frame in frames[: Belief.TRIAL]:
            if frame.measured.any():
                coverage = self._explain(belief, frame, self._measurement(frame, frame.positions)).prediction.coverage
        return belief, coverage

    def _many(self, frame: TrackerFrame) -> bool:
        return int(frame.measured.sum()) > self.FEW

    def solve_take(self, frames: Sequence[TrackerFrame], progress: Progress = no_progress) -> Reconstruction:
        """Forgets the past and solves a whole take of frames one database period apart.

        Raises SettingError for a take without frames.
        """
        if not frames:
            raise SettingError("a take without frames cannot be solved")
        self.reset()
        self.start(frames[: 1 - int(OFFSETS.min())])
        solutions = []
        for number, frame in enumerate(frames):
            solutions.append(self.solve(frame))
            progress(number + 1, len(frames))
        return Reconstruction.of(solutions, self.skeleton, self.database.fps)

    def solve(self, frame: TrackerFrame) -> Solution:
        """The most probable pose for the trackers of one frame."""
        began = perf_counter_ns()
        if frame.measured.any():
            self._seen_s[frame.measured] = frame.time_s
        elif self._last is None or frame.time_s - self._seen_s.max() > self.settings.hold_after_s:
            return self._held(frame)
        frame = self._without_noise(frame)
        if not self._belief.past:
            self.start([frame])
        positions = self._eased(frame)
        measurement = self._measurement(frame, positions, self._passed_orientations(frame))
        explained = self._explain(self._belief, frame, measurement)
        self.problem, self.solved = explained.problem, explained.found.q
        self._measured = explained.measured
        if self._last is not None and not self._gone(frame).any():
            self._memory.add(explained.moment)
        self._reconsider(frame, measurement, explained.prediction)
        shown = self._easing.eased(explained.pose)
        ended = perf_counter_ns()
        stages = explained.stage_ns | {"rest": ended - began - sum(explained.stage_ns.values())}
        self._last = Solution(
            shown,
            frozen(self._sigma(frame, measurement.position_sigma_m)),
            explained.prediction.coverage,
            frozen(footings(frame, False)),
            stages,
            explained.prediction.rows,
            explained.heading,
        )
        return self._last

    def _explain(self, belief: Belief, frame: TrackerFrame, measurement: Measurement) -> "_Explained":
        """The most probable pose for the trackers of one frame by a belief, which goes on by it."""
        began = perf_counter_ns()
        heading = belief.past[-1].heading
        filled = self._filled(belief, measurement.positions)
        seen = Observation(filled, frame.measured, None if self._many(frame) else self._way(heading))
        prediction = self._predictor.predict(belief.past, seen)
        predicted = perf_counter_ns()
        moment = self._moment(belief, filled)
        measured = effectors(measurement, self.role_joints, self.mounting, heading)
        points = self._and_recalled(frame, moment, measured)
        problem = MapProblem(self._body, prediction.prior, points, self._lower, self._upper)
        found = self.map_solver.solve(problem, prediction.prior.mean)
        solved = perf_counter_ns()
        pose = self.space.pose(found.q, heading, frame.time_s)
        own = self._solved_pose(pose, found.q, heading)
        belief.add(own, self._all_poses.implausibility(own.q), found.energy)
        stages = {"prior": predicted - began, "map": solved - predicted}
        return _Explained(pose, prediction, problem, found, heading, measured, moment, stages)

    def _gone(self, frame: TrackerFrame) -> NDArray[np.bool_]:
        """(6,) trackers that were there once and are not now."""
        return ~frame.measured & np.isfinite(self._seen_s)

    def _moment(self, belief: Belief, filled: NDArray[np.float64]) -> NDArray[np.float64]:
        """(2, 6, 3) metres, seen from the last heading frame: tracked joints, and their ways over the last poses."""
        earliest, heading = belief.past[0], belief.past[-1].heading
        earlier = seen_from(earliest.joints[self.role_joints][None], earliest.heading[None], heading[None])[0]
        return np.stack((filled, filled - earlier))

    def _and_recalled(self, frame: TrackerFrame, moment: NDArray[np.float64], points: Effectors) -> Effectors:
        """With the joints of lost trackers where this session says they are."""
        gone = self._gone(frame)
        if not gone.any():
            return points
        recalled = self._memory.recall(moment, frame.measured, gone)
        return and_recalled(points, gone, recalled.places, recalled.sigma_m, self.role_joints)

    def _without_noise(self, frame: TrackerFrame) -> TrackerFrame:
        """The frame with filtered positions; takes note of its noise."""
        self._noise.add(frame)
        return replace(frame, positions=frozen(self._filter.filtered(frame.positions, self._noise.sigma_m)))

    def _held(self, frame: TrackerFrame) -> Solution:
        """The last pose again; before any tracker was seen, the database's mean pose at the world's origin."""
        if self._last is None:
            q = np.asarray(self._poses[:: max(1, len(self._poses) // 1000)]).mean(axis=0, dtype=np.float64)
            pose, sigma = self.space.pose(q, _WORLD, frame.time_s), np.full(len(self.skeleton), np.pi)
            return Solution(pose, frozen(sigma), np.inf, footings(frame, True), {})
        last = self._last
        pose = Pose(frame.time_s, last.pose.root_position, last.pose.rotations)
        sigma = np.minimum(last.sigma * (1 + frame.time_s - self._seen_s.max()), np.pi)
        return Solution(pose, frozen(sigma), last.coverage, frozen(footings(frame, True)), {})

    def _eased(self, frame: TrackerFrame) -> NDArray[np.float64]:
        """The positions (6, 3) metres, world, to solve for; takes note of the frame. Starts anew where it must."""
        self._trackers.add(frame.positions)
        last = self._belief.past[-1]
        expected = seen_from(self._going_on(self._belief)[None], last.heading[None], _WORLD[None])[0]
        if self._last is None:
            return self._return.eased(frame, None)
        if (self._last.states != Footing.MEASURED).all() and frame.measured.any():
            off = np.linalg.norm((expected - frame.positions)[frame.measured], axis=1).mean()
            if off > self.FAR_M:
                self.start([frame])
                self._easing.begin(held=True)
                return self._return.eased(frame, None)
        return self._return.eased(frame, expected)

    def _filled(self, belief: Belief, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tracked joints (6, 3) seen from the last heading frame, where no tracker tells where they would go on to."""
        last = belief.past[-1]
        seen = seen_from(positions[None], _WORLD[None], last.heading[None])[0]
        return np.where(np.isfinite(seen), seen, self._going_on(belief)) - last.arms

    def _way(self, heading: NDArray[np.float64]) -> Sighting | None:
        """Where trackers were before the last pose, seen from its heading frame in the database's scale."""
        seen = self._trackers.sighting()
        before = seen.offsets < 0
        if not before.any():
            return None
        points = seen_from(seen.points[before].reshape(1, -1, 3), _WORLD[None], heading[None])
        return Sighting(seen.offsets[before] + 1, points.reshape(-1, len(ROLES), 3) / self.scale)

    def _going_on(self, belief: Belief) -> NDArray[np.float64]:
        """Where (6, 3) the trackers come to when they move on as they did, seen from the last heading frame."""
        before, last = belief.past[-2], belief.past[-1]
        points = (before.joints[self.role_joints] + before.arms)[None]
        earlier = seen_from(points, before.heading[None], last.heading[None])[0]
        return 2 * (last.joints[self.role_joints] + last.arms) - earlier

    def _measurement(
        self, frame: TrackerFrame, positions: NDArray[np.float64], orientations: NDArray[np.float64] | None = None
    ) -> Measurement:
        s = self.settings
        sigma = max(s.tracker_sigma_m, s.noise_gain * self._noise.sigma_m)
        unknown = np.full_like(frame.orientations, np.nan)
        return Measurement(positions, unknown if orientations is None else orientations, sigma, s.orientation_sigma)

    def _passed_orientations(self, frame: TrackerFrame) -> NDArray[np.float64] | None:
        """Those (6, 4) that count, NaN for the others; None where none was measured or none shall count."""
        if not self.settings.orientations or not np.isfinite(frame.orientations).any():
            return None
        last = self._belief.past[-1]
        turns = Rotation.from_matrix(last.role_turns).as_quat()
        joints = multiply(np.tile(about_up(last.heading[2]), (len(ROLES), 1)), turns)
        off = multiply(inverse(joints), self.mounting.joint_rotations(frame.orientations))
        return self._gate.passed(frame.orientations, np.linalg.norm(logarithm(off), axis=-1))

    def _solved_pose(self, pose: Pose, q: NDArray[np.float64], heading: NDArray[np.float64]) -> SolvedPose:
        """A pose, also given as q (D,) seen from `heading` (3,), as its own heading frame sees it."""
        own = self.space.heading(pose.root_position, pose.rotations[0])
        q = q.copy()
        see_from(q, heading, own)
        return self._placed(q, own)

    def _placed(self, q: NDArray[np.float64], heading: NDArray[np.float64]) -> SolvedPose:
        place(self._body, q, self._state)
        turns = self._state.world[self.role_joints]
        return SolvedPose(q, heading, self._state.position.copy(), self.mounting.arms(turns), turns)

    def _belief_in(self, matches: Matches, last: int) -> Belief:
        """Poses around the best matching row as the past, up to the one `last` frames after it."""
        row, heading = int(matches.rows[0]), matches.heading
        first = self.database.clip_of(row).first
        past = []
        for step in range(last - SPAN + 1, last + 1):
            before = max(row + step, first)
            q = self._poses[before].astype(np.float64)
            q[:3] *= self.scale
            own, at = self._headings[before].astype(np.float64), self._headings[row].astype(np.float64)
            ground = np.array([[[own[0], 0.0, own[1]]]])
            x, _, z = seen_from(seen_from(ground, _WORLD[None], at[None]), heading[None], _WORLD[None])[0, 0]
            yaw = heading[2] + own[2] - at[2]
            past.append(self._placed(q, np.array([self.scale * x, self.scale * z, yaw])))
        return Belief(past)

    def _reconsider(self, frame: TrackerFrame, measurement: Measurement, prediction: Prediction) -> None:
        """Goes on looking for a better explanation of the trackers' way, and takes it where there is one.

        What explains few trackers clearly better is believed at once; many hold nearly any body, so that there other
        facings are tried beside where the neighbours are far.
        """
        if not self.settings.relocalise:
            return
        better = self._contested(frame, measurement)
        lost = self._many(frame) and self._rivals.wanted and self._lost(self._belief, prediction.coverage)
        if better is None and (lost or 2 <= frame.measured.sum() <= self.FEW):
            found = self._relocaliser.look(self._trackers, self.scale)
            if found is not None and lost:
                self._rivals.propose(found, self._belief.past[-1].heading[2])
            elif found is not None:
                better = self._fitting_better(found, prediction)
        if better is not None:
            self._belief = better
            self._rivals.reset()
            self._relocaliser.reset()
            self._easing.begin()

    def _fitting_better(self, found: Finding, prediction: Prediction) -> Belief | None:
        """What was found, where it fits the trackers' way clearly better than this pose's own neighbours."""
        here = self._belief.past[-1].heading / np.array([self.scale, self.scale, 1.0])
        own = self._matcher.error(found.sighting, prediction.rows, here)
        return self._belief_in(found.best, last=0) if found.beats(own) else None

    def _contested(self, frame: TrackerFrame, measurement: Measurement) -> Belief | None:
        """Lets a rival explain the frame too; the rival, when its trial is over and it was clearly better."""
        rival = self._rivals.rival(self._trackers, self.scale, lambda found: self._belief_in(found, last=0))
        if rival is None:
            return None
        self._explain(rival, frame, measurement)
        return self._rivals.judged(rival, self.CLEARLY * self._belief.cost)

    def _sigma(self, frame: TrackerFrame, tracker_sigma_m: float) -> NDArray[np.float64]:
        """(J,) radians: the root of a joint's summed posterior variance over its three directions, calibrated.

        What the last pose says is left out of the posterior, since it is as wrong as this one: its errors last. Lost
        trackers fade.
        """
        unseen_s = frame.time_s - self._seen_s
        known = and_lost(self._measured, unseen_s, self.STRAY_M_S, self.role_joints, self.mounting)
        expected = self.problem.prior.without_last
        root = self.map_solver.covariance_root(replace(self.problem, prior=expected, effectors=known), self.solved)
        variance = np.einsum("ij,ij->i", root, root)[3:].reshape(-1, 3).sum(axis=1)
        surprise = 2 * expected.energy(self.solved) / self.space.dof
        factor = calibration(surprise, int(frame.measured.sum()), tracker_sigma_m)
        sigma = np.zeros(len(self.skeleton))
        sigma[[0, *self.space.moving]] = factor * np.sqrt(variance)
        return np.minimum(sigma, np.pi)

    def _warm_up(self) -> None:
        """Solves a few frames of the database, so that everything is compiled and loaded, and forgets them."""
        tracks = np.asarray(self.database.tracks[: 1 - OFFSETS.min() + 1], np.float64)
        states = np.ones(len(ROLES), np.int8)
        unknown = np.full((len(ROLES), 4), np.nan)
        for number, positions in enumerate(tracks):
            self.solve(TrackerFrame(number / self.database.fps, positions * self.scale, unknown, states))
        self.reset()


def calibration(surprise: float, trackers: int, tracker_sigma_m: float) -> float:
    """What a posterior deviation is multiplied with to hold two thirds of the errors.

    surprise: mean square distance of the solution from what the neighbours alone expect, in their standard deviations;
    trackers: how many there are; tracker_sigma_m: metres, what each counts with. Surprise says how wrong the neighbours
    are, as far as the trackers can tell: the fewer and the noisier they are, the less they move the solution for the
    same error. Fitted on four sets of motion capture, and checked on each with that one left out.
    """
    return 5.6 * (max(surprise, 1e-3) / max(trackers, 1) ** 2) ** (1 / 3) * (1 + tracker_sigma_m / 0.06)


def _predictor(database: MotionDatabase, scale: float, settings: SolverSettings) -> Predictor:
    """The prior of the method in the settings. Raises SettingError naming the methods there are."""
    if settings.method == "default":
        return DefaultPredictor(database, scale, settings.neighbours, settings.local)
    if settings.method == "paper":
        return PaperPredictor(database, scale)
    raise choice_error("method", settings.method, METHODS)


def reconstruct(
    frames: Sequence[TrackerFrame],
    database: MotionDatabase,
    skeleton: Skeleton | None = None,
    settings: SolverSettings | None = None,
    progress: Progress = no_progress,
    predictor: Predictor | None = None,
    mounting: Mounting | None = None,
) -> Reconstruction:
    """Solves a whole take of frames one database period apart; the same input gives the same bits."""
    return Reconstructor(database, skeleton, settings, predictor, mounting).solve_take(frames, progress)
