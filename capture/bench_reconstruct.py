"""How fast a frame is solved, stage by stage, and how the parts compare with what could stand in their place."""

import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from capture.latency import LatencyRecorder, percentiles_ms
from devices.frame import TrackerFrame
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.body_kinematics import BodyState, place
from reconstruction.database import Clip, MotionDatabase
from reconstruction.kinematics import world_joints
from reconstruction.likelihood import energy_and_gradient, jacobian, residuals
from reconstruction.map_problem import MapProblem
from reconstruction.solver import Reconstructor, SolverSettings


@dataclass(frozen=True)
class BenchPlan:
    """frames: solved in all; clip_frames: of one clip, at most; roles: trackers; noise_m: metres; seed: of the noise
    and the choice of clips; methods: of the solver."""

    frames: int = 1200
    clip_frames: int = 240
    roles: tuple[str, ...] = ROLES
    noise_m: float = 0.003
    seed: int = 0
    methods: tuple[str, ...] = ("default", "paper")


def bench_reconstruct(
    database: MotionDatabase, plan: BenchPlan | None = None, progress: Progress = no_progress
) -> dict[str, dict]:
    """Milliseconds by stage for each method, neighbour recall, and the same problems by SciPy's least squares.

    The frames are the database's own clips with noise on the trackers.
    """
    plan = plan or BenchPlan()
    clips = _takes(database, plan)
    figures: dict[str, dict] = {"database": {"poses": len(database), "windows": len(database.windows)}}
    for number, method in enumerate(plan.methods):
        figures[method] = _timed(database, clips, method)
        progress(number + 1, len(plan.methods) + 2)
    figures["neighbours"] = neighbour_figures(database)
    progress(len(plan.methods) + 1, len(plan.methods) + 2)
    figures["map problem"] = map_figures(database, clips[0])
    progress(len(plan.methods) + 2, len(plan.methods) + 2)
    return figures


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


def _timed(database: MotionDatabase, takes: list[list[TrackerFrame]], method: str) -> dict:
    """Milliseconds by stage and of whole frames, and how many times real time that is."""
    began = time.perf_counter()
    solver = Reconstructor(database, settings=SolverSettings(method=method))
    ready = time.perf_counter() - began
    recorder, whole, first = LatencyRecorder(1_000_000), [], []
    for take in takes:
        solver.reset()
        for number, frame in enumerate(take):
            start = time.perf_counter_ns()
            solution = solver.solve(frame)
            (whole if number else first).append((time.perf_counter_ns() - start) * 1e-6)
            recorder.add_all(solution.stage_ns)
    return {
        "ready_s": round(ready, 3),
        "first_frame_ms": round(float(np.median(first)), 3),
        "frame_ms": percentiles_ms(np.array(whole)),
        "stages_ms": recorder.summary(),
        "times_real_time": round(1000 / database.fps / float(np.mean(whole)), 1),
    }


def neighbour_figures(database: MotionDatabase, queries: int = 200, count: int = 48) -> dict:
    """Milliseconds a search, and its recall against an exact scan, for windows moved half the database's spacing."""
    rng = np.random.default_rng(0)
    stored = database.index.vectors()
    asked = stored[rng.choice(len(stored), queries)]
    asked = asked + rng.normal(0, 0.5 * database.spacing / np.sqrt(asked.shape[1]), asked.shape).astype(np.float32)
    milliseconds, recalled = [], []
    squares = np.einsum("nf,nf->n", stored, stored)
    for query in asked:
        began = time.perf_counter_ns()
        numbers, _ = database.index.nearest(query, count)
        milliseconds.append((time.perf_counter_ns() - began) * 1e-6)
        near = np.argpartition(squares - 2 * stored @ query, min(4 * count, len(stored) - 1))[: 4 * count]
        exact = np.sort(np.linalg.norm(stored[near] - query, axis=1))[:count]
        found = np.linalg.norm(stored[numbers] - query, axis=1)
        recalled.append(np.mean(found <= exact[-1] * (1 + 1e-5)))  # by distance: equal windows are equally right
    return {
        "search_ms": percentiles_ms(np.array(milliseconds)),
        f"recall_at_{count}": round(float(np.mean(recalled)), 4),
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
