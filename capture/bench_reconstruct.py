"""How fast a frame is solved, stage by stage, and how the parts compare with what could stand in their place."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, zip_longest

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from capture.bench_neighbours import history_figures, neighbour_figures
from capture.evaluation_runs import METHODS, predictor_of
from capture.latency import LatencyRecorder, percentiles_ms
from devices.frame import TrackerFrame
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.body_kinematics import BodyState, place
from reconstruction.database import Clip, MotionDatabase, open_database
from reconstruction.kinematics import world_joints
from reconstruction.likelihood import energy_and_gradient, jacobian, residuals
from reconstruction.map_problem import MapProblem
from reconstruction.solution import Solution
from reconstruction.solver import Reconstructor


@dataclass(frozen=True)
class BenchPlan:
    """frames: solved in all by our own and the paper's method, a quarter of them by the others; clip_frames: of one
    clip, at most; roles: trackers; noise_m: metres; seed: of the noise and the choice of clips; methods: that are
    timed; queries: neighbour searches that are compared with exact ones."""

    frames: int = 1200
    clip_frames: int = 240
    roles: tuple[str, ...] = ROLES
    noise_m: float = 0.003
    seed: int = 0
    methods: tuple[str, ...] = tuple(reversed(METHODS))
    queries: int = 200


def bench_reconstruct(
    database: MotionDatabase, plan: BenchPlan | None = None, progress: Progress = no_progress
) -> dict[str, dict]:
    """Milliseconds by stage for each method; time and recall of the neighbour searches; the same problems by SciPy's
    least squares.

    The frames are the database's own clips with noise on the trackers.
    """
    plan = plan or BenchPlan()
    takes = _takes(database, plan)
    few = _first_frames(takes, max(plan.frames // 4, 60))
    steps: dict[str, Callable[[], dict]] = {"database": lambda: _opening(database)}
    for method in plan.methods:
        frames = takes if method in ("default", "paper") else few
        steps[method] = lambda method=method, frames=frames: _timed(database, frames, method, plan.roles)
    steps["neighbours"] = lambda: neighbour_figures(database, few, plan.queries)
    steps["paper's neighbours"] = lambda: history_figures(database, few, plan.queries)
    steps["map problem"] = lambda: map_figures(database, takes[0])
    figures: dict[str, dict] = {}
    for number, (name, measure) in enumerate(steps.items()):
        figures[name] = measure()
        progress(number + 1, len(steps))
    return figures


def growth(databases: Sequence[MotionDatabase], plan: BenchPlan | None = None) -> dict[str, dict]:
    """Milliseconds a frame of our own method takes on each of several databases, and how many times as long on the
    largest as on the smallest.

    The databases take turns, take by take, so that whatever else the machine does befalls all of them.
    """
    plan = plan or BenchPlan()
    databases = sorted(databases, key=len)
    solvers = [Reconstructor(database) for database in databases]
    times = [_FrameTimes() for _ in databases]
    for takes in zip_longest(*(_takes(database, plan) for database in databases), fillvalue=[]):
        for solver, measured, take in zip(solvers, times, takes, strict=True):
            measured.solve(solver, take)
    found = {f"{len(d)} poses": measured.percentiles() for d, measured in zip(databases, times, strict=True)}
    small, large = times[0].percentiles(), times[-1].percentiles()
    ratios = {name: {p: round(large[name][p] / small[name][p], 2) for p in ("p50", "p99")} for name in small}
    return found | {"largest over smallest": ratios}


def _opening(database: MotionDatabase) -> dict:
    began = time.perf_counter()
    open_database(database.path)
    opened = time.perf_counter() - began
    return {"poses": len(database), "windows": len(database.windows), "opened_s": round(opened, 3)}


def _takes(database: MotionDatabase, plan: BenchPlan) -> list[list[TrackerFrame]]:
    """Takes of noisy trackers on clips chosen by the seed."""
    rng = np.random.default_rng(plan.seed)
    takes: list[list[TrackerFrame]] = []
    left = plan.frames
    for number in rng.permutation(len(database.clips)):
        clip = database.clips[int(number)]
        part = Clip(clip.name, clip.first, min(clip.frames, plan.clip_frames, left))
        takes.append(_frames(database, part, plan, rng))
        left -= part.frames
        if left <= 0:
            break
    return takes


def _first_frames(takes: list[list[TrackerFrame]], count: int) -> list[list[TrackerFrame]]:
    """The first takes, `count` frames together."""
    chosen: list[list[TrackerFrame]] = []
    for take in takes:
        left = count - sum(len(one) for one in chosen)
        if left > 1:
            chosen.append(take[:left])
    return chosen


def _frames(database: MotionDatabase, clip: Clip, plan: BenchPlan, rng: np.random.Generator) -> list[TrackerFrame]:
    motion = database.motion(clip)
    joints, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    roles = {role: motion.skeleton.role_joint(role) for role in plan.roles}
    return [
        TrackerFrame.from_positions(
            number / database.fps, {role: now[joint] + rng.normal(0, plan.noise_m, 3) for role, joint in roles.items()}
        )
        for number, now in enumerate(joints)
    ]


def _timed(database: MotionDatabase, takes: list[list[TrackerFrame]], method: str, roles: Sequence[str]) -> dict:
    """Milliseconds by stage and of whole frames, by the clock and by what processors worked, the frames that start a
    take apart; and how many times real time a whole take is solved at."""
    began = time.perf_counter()
    skeleton = database.space.skeleton
    solver = Reconstructor(database, predictor=predictor_of(method, database, skeleton, roles))
    ready = time.perf_counter() - began
    recorder, times = LatencyRecorder(1_000_000), _FrameTimes()
    for take in takes:
        for solution in times.solve(solver, take):
            recorder.add_all(solution.stage_ns)
    moved_s = sum(len(take) for take in takes) / database.fps
    return {
        "ready_s": round(ready, 3),
        "first_frame_ms": round(float(np.median(times.first)), 3),
        **times.percentiles(),
        "stages_ms": recorder.summary(),
        "times_real_time": round(1000 * moved_s / (sum(times.clock) + sum(times.first)), 1),
    }


@dataclass(frozen=True, eq=False)
class _FrameTimes:
    """Milliseconds of frames by the clock and by what processors worked; of those that start a take apart."""

    clock: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)
    first: list[float] = field(default_factory=list)

    def solve(self, solver: Reconstructor, take: list[TrackerFrame]) -> list[Solution]:
        """Solves a take from a start without a past, and notes the times."""
        solver.reset()
        solutions = []
        for number, frame in enumerate(take):
            start, work = time.perf_counter_ns(), time.process_time_ns()
            solutions.append(solver.solve(frame))
            worked, took = time.process_time_ns() - work, time.perf_counter_ns() - start
            (self.clock if number else self.first).append(took * 1e-6)
            if number:
                self.processor.append(worked * 1e-6)
        return solutions

    def percentiles(self) -> dict[str, dict[str, float]]:
        """`frame_ms` and `processor_ms`."""
        return {
            name: percentiles_ms(np.array(v))
            for name, v in (("frame_ms", self.clock), ("processor_ms", self.processor))
        }


def map_figures(database: MotionDatabase, take: list[TrackerFrame]) -> dict:
    """One frame's MAP problem again and again: NLopt as we use it, SciPy's least squares, the kernel alone."""
    problems = _problems(database, take[:60])
    solver = Reconstructor(database).map_solver
    ours, theirs, kernel, gaps = [], [], [], []
    for problem in problems:
        began = time.perf_counter_ns()
        found = solver.solve(problem, problem.prior.mean)
        ours.append((time.perf_counter_ns() - began) * 1e-6)
        began = time.perf_counter_ns()
        best = _by_least_squares(problem)
        theirs.append((time.perf_counter_ns() - began) * 1e-6)
        gaps.append(found.energy - problem.energy(best.astype(np.float64)))
        kernel.append(_kernel_ms(problem))
    return {
        "nlopt_ms": percentiles_ms(np.array(ours)),
        "scipy_least_squares_ms": percentiles_ms(np.array(theirs)),
        "kinematics_and_gradient_us": round(1000 * float(np.median(kernel)), 2),
        "energy_above_least_squares": {"p50": round(float(np.median(gaps)), 5), "max": round(float(np.max(gaps)), 5)},
    }


def _problems(database: MotionDatabase, take: list[TrackerFrame]) -> list[MapProblem]:
    """The problems that a solver meets on a take."""
    solver = Reconstructor(database)
    problems = []
    for frame in take:
        solver.solve(frame)
        problems.append(solver.problem)
    return problems


def _by_least_squares(problem: MapProblem) -> NDArray[np.floating]:
    """The same optimum by SciPy's trust-region least squares with the analytic Jacobian."""
    root = np.linalg.cholesky(problem.prior.precision).T
    state = BodyState.of(len(problem.body.parents))

    def all_residuals(q: NDArray[np.float64]) -> NDArray[np.floating]:
        place(problem.body, q, state)
        return np.concatenate((root @ (q - problem.prior.mean), residuals(problem.effectors, state)))

    def all_derivatives(q: NDArray[np.float64]) -> NDArray[np.floating]:
        place(problem.body, q, state)
        return np.concatenate((root, jacobian(problem.body, problem.effectors, state, len(q))))

    found = least_squares(all_residuals, problem.prior.mean, jac=all_derivatives, method="lm")  # type: ignore[arg-type]
    return found.x


def _kernel_ms(problem: MapProblem, times: int = 50) -> float:
    """Milliseconds of one forward kinematics with energy and gradient."""
    state, gradient = BodyState.of(len(problem.body.parents)), np.empty(len(problem.prior.mean))
    marks = []
    for _ in range(times):
        marks.append(time.perf_counter_ns())
        energy_and_gradient(problem.body, problem.effectors, problem.prior.mean, state, gradient)
    return float(np.median([b - a for a, b in pairwise(marks)])) * 1e-6
