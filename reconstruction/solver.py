"""From tracker frames to poses, one frame at a time: retrieve, build the problem, solve it, remember."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter_ns

import numpy as np
from numpy.typing import NDArray

from devices.errors import SettingError
from devices.frame import TrackerFrame, frozen
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.database import MotionDatabase
from reconstruction.likelihood import Effectors
from reconstruction.local_model import LocalModelSettings, gather, local_prior, see_from
from reconstruction.map_problem import GaussianPrior, MapProblem
from reconstruction.map_solver import MapSolution, MapSolver
from reconstruction.motion import Motion, Pose
from reconstruction.motion_operations import leg_length
from reconstruction.pose_space import ROOT_DOF
from reconstruction.skeleton import Skeleton
from reconstruction.start import match_trackers
from reconstruction.window_features import WindowFeatures, seen_from


@dataclass(frozen=True)
class SolverSettings:
    """How a frame is solved.

    neighbours: K, 8 to 256.
    candidates: windows retrieved before near duplicates are thinned out, at least `neighbours`.
    apart: frames, how far two neighbours of one clip must be from each other, at least 1.
    tracker_sigma_m: metres, standard deviation of a measured position, above 0.
    local: how the neighbours become a Gaussian.
    """

    neighbours: int = 64
    candidates: int = 256
    apart: int = 2
    tracker_sigma_m: float = 0.002
    local: LocalModelSettings = field(default_factory=LocalModelSettings)


@dataclass(frozen=True, eq=False)
class Solution:
    """One solved frame.

    sigma: (J,) radians, standard deviation of each joint's rotation by the posterior; 0 for joints that never turn.
    coverage: distance to the neighbours over the database's own spacing: about 1 inside the data, more outside.
    states: (6,) int8 of `TrackerState`, as the frame had them.
    stage_ns: nanoseconds by stage.
    """

    pose: Pose
    sigma: NDArray[np.float64]
    coverage: float
    states: NDArray[np.int8]
    stage_ns: dict[str, int]


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A whole take, solved. motion: one pose a frame; sigma (T, J); coverage (T,); milliseconds (T,) a frame."""

    motion: Motion
    sigma: NDArray[np.float64]
    coverage: NDArray[np.float64]
    milliseconds: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Past:
    """A solved pose: q (D,) seen from its own heading frame (3,), and its joints (J, 3) metres seen from there."""

    q: NDArray[np.float64]
    heading: NDArray[np.float64]
    joints: NDArray[np.float64]


class Reconstructor:
    """Solves frames that come one database period apart, on a body with the database's joints."""

    def __init__(
        self, database: MotionDatabase, skeleton: Skeleton | None = None, settings: SolverSettings | None = None
    ):
        """skeleton: the performer's; the database's own where None. Raises SettingError where its joints differ."""
        self.database = database
        self.settings = settings or SolverSettings()
        skeleton = skeleton or database.space.skeleton
        if not database.space.skeleton.same_tree(skeleton):
            raise SettingError("the performer's skeleton has other joints than the database's")
        self.space = database.space.with_skeleton(skeleton)
        self.scale = leg_length(skeleton) / leg_length(database.space.skeleton)
        self._body = Body.of(self.space)
        self._state = BodyState.of(len(skeleton))
        self._solver = MapSolver(self._body, self.space.dof)
        self._role_joints = np.array([skeleton.role_joint(role) for role in ROLES], np.int64)
        self._poses, self._headings = np.asarray(database.poses), np.asarray(database.headings)
        self._tracks, self._windows = np.asarray(database.tracks), np.asarray(database.windows)
        self._clip_of_window = np.searchsorted(database.firsts, self._windows, side="right")
        self._lower, self._upper = np.asarray(database.bounds, np.float64).T.copy()
        self._lower[:ROOT_DOF], self._upper[:ROOT_DOF] = -np.inf, np.inf
        self._past: deque[_Past] = deque(maxlen=WindowFeatures.SPAN)

    @property
    def skeleton(self) -> Skeleton:
        """The performer's."""
        return self.space.skeleton

    def reset(self) -> None:
        """Forgets the past: the next frame starts anew."""
        self._past.clear()

    def solve(self, frame: TrackerFrame) -> Solution:
        """The most probable pose for the trackers of one frame."""
        began = perf_counter_ns()
        prior, heading, coverage = self._started(frame) if not self._past else self._predicted(frame)
        prepared = perf_counter_ns()
        effectors = self._effectors(frame, heading)
        problem = MapProblem(self._body, prior, effectors, self._lower, self._upper)
        found = self._solver.solve(problem, prior.mean)
        solved = perf_counter_ns()
        pose = self.space.pose(found.q, heading, frame.time_s)
        self._remember(pose)
        stages = {"prior": prepared - began, "map": solved - prepared, "output": perf_counter_ns() - solved}
        return Solution(pose, frozen(self._sigma(found)), coverage, frame.states, stages)

    def _predicted(self, frame: TrackerFrame) -> tuple[GaussianPrior, NDArray[np.float64], float]:
        """The prior from windows like the last poses and these trackers, seen from the last pose's heading frame."""
        s = self.settings
        last, earliest = self._past[-1], self._past[0]
        earlier = seen_from(earliest.joints[None], earliest.heading[None], last.heading[None])
        history = WindowFeatures.history(last.joints[None] / self.scale, earlier / self.scale)
        trackers = self._trackers(frame, last)
        feature = self.database.features.features(history, trackers[None] / self.scale)[0]
        numbers, distances = self.database.index.nearest(feature, s.candidates)
        keep = _thinned(self._windows[numbers], self._clip_of_window[numbers], s.apart, s.neighbours)
        rows, distances = self._windows[numbers[keep]].astype(np.int64), distances[keep]
        following = gather(rows, 0, self._poses, self._headings)
        before = gather(rows, 1, self._poses, self._headings)
        following[:, :3] *= self.scale
        before[:, :3] *= self.scale
        coverage = float(distances[: max(1, len(distances) // 8)].mean() / self.database.spacing)
        prior = local_prior(following, following - before, _weights(distances), last.q, max(1.0, coverage / 2), s.local)
        return prior, last.heading, coverage

    def _started(self, frame: TrackerFrame) -> tuple[GaussianPrior, NDArray[np.float64], float]:
        """The prior from the poses whose tracked joints fit these trackers, seen from the best one's heading frame."""
        s = self.settings
        match = match_trackers(self._tracks, frame.positions / self.scale, s.neighbours)
        heading = match.headings[0].copy()
        heading[:2] *= self.scale
        following = self._poses[match.rows].astype(np.float64)
        following[:, :3] *= self.scale
        for q, own in zip(following, match.headings * np.array([self.scale, self.scale, 1]), strict=True):
            see_from(q, own, heading)
        coverage = float(match.errors[0] / self.database.spacing)
        weights = _weights(match.errors)
        return local_prior(following, following, weights, None, max(1.0, coverage / 2), s.local), heading, coverage

    def _trackers(self, frame: TrackerFrame, last: _Past) -> NDArray[np.float64]:
        """Tracker positions (6, 3) seen from the last heading frame, missing ones where their joints would go on to."""
        seen = seen_from(frame.positions[None], np.zeros((1, 3)), last.heading[None])[0]
        before = self._past[-2] if len(self._past) > 1 else last
        earlier = seen_from(before.joints[None], before.heading[None], last.heading[None])[0]
        going_on = (2 * last.joints - earlier)[self._role_joints]
        return np.where(np.isfinite(seen), seen, going_on)

    def _effectors(self, frame: TrackerFrame, heading: NDArray[np.float64]) -> Effectors:
        """The measured positions as points on the body, seen from a heading frame."""
        roles = np.flatnonzero(frame.measured)
        targets = seen_from(frame.positions[None, roles], np.zeros((1, 3)), heading[None])[0]
        weights = np.full(len(roles), 1 / self.settings.tracker_sigma_m)
        return Effectors(self._role_joints[roles], np.zeros((len(roles), 3)), targets, weights)

    def _remember(self, pose: Pose) -> None:
        heading = self.space.heading(pose.root_position, pose.rotations[0])
        q = self.space.coordinates(pose.root_position[None], pose.rotations[None], heading)[0]
        place(self._body, q, self._state)
        past = _Past(q, heading, self._state.position.copy())
        while len(self._past) < WindowFeatures.SPAN - 1:
            self._past.append(past)
        self._past.append(past)

    def _sigma(self, found: MapSolution) -> NDArray[np.float64]:
        """(J,) radians: the root mean square over a joint's three directions of its posterior deviation."""
        variance = np.einsum("ij,ij->i", found.covariance_root, found.covariance_root)[3:].reshape(-1, 3).sum(axis=1)
        sigma = np.zeros(len(self.space.skeleton))
        sigma[0] = np.sqrt(variance[0])
        sigma[self.space.moving] = np.sqrt(variance[1:])
        return sigma


def reconstruct(
    frames: Sequence[TrackerFrame],
    database: MotionDatabase,
    skeleton: Skeleton | None = None,
    settings: SolverSettings | None = None,
    progress: Progress = no_progress,
) -> Reconstruction:
    """Solves a whole take of frames one database period apart; the same input gives the same bits."""
    if not frames:
        raise SettingError("a take without frames cannot be solved")
    solver = Reconstructor(database, skeleton, settings)
    solutions = []
    for number, frame in enumerate(frames):
        solutions.append(solver.solve(frame))
        progress(number + 1, len(frames))
    motion = Motion(
        solver.space.skeleton,
        frozen(np.array([s.pose.root_position for s in solutions])),
        frozen(np.array([s.pose.rotations for s in solutions])),
        database.fps,
        "reconstruction",
    )
    return Reconstruction(
        motion,
        frozen(np.array([s.sigma for s in solutions])),
        frozen(np.array([s.coverage for s in solutions])),
        frozen(np.array([sum(s.stage_ns.values()) / 1e6 for s in solutions])),
    )


def _weights(distances: NDArray[np.floating]) -> NDArray[np.float64]:
    """(K,) Gaussian weights (eq. 7) that sum to one, as wide as the distances are typically beyond the nearest."""
    width = max(float(np.median(distances)), 1e-6)
    weights = np.exp(-0.5 * (distances.astype(np.float64) / width) ** 2)
    return weights / weights.sum()


def _thinned(rows: NDArray[np.int32], clips: NDArray[np.int64], apart: int, count: int) -> NDArray[np.int64]:
    """Places of at most `count` rows, in order, none nearer than `apart` frames to a better one of its clip."""
    kept: list[int] = []
    taken: set[tuple[int, int]] = set()
    for number, (row, clip) in enumerate(zip(rows.tolist(), clips.tolist(), strict=True)):
        if any((clip, row + shift) in taken for shift in range(1 - apart, apart)):
            continue
        taken.add((clip, row))
        kept.append(number)
        if len(kept) == count:
            break
    return np.array(kept, np.int64)
