"""Fitting a body to its trackers: segment lengths and mounting offsets from a held T-pose and free movement.

Every frame's residual at the prior's mean tells of the body as well as of the pose. With the pose integrated out (its
prior N(mu, Lambda^-1) makes the trackers' covariance S = sigma^2 I + J Lambda^-1 J^T), what is left is a weighted least
squares problem in a few lengths and offsets, with priors from anthropometry; poses and body are solved in turn until
the body settles.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.errors import FileError, SettingError
from devices.frame import TrackerFrame, frozen
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.database import MotionDatabase
from reconstruction.kinematics import world_joints
from reconstruction.likelihood import jacobian, residuals
from reconstruction.local_model import LocalModelSettings
from reconstruction.motion import Pose
from reconstruction.motion_operations import leg_length
from reconstruction.mounting import Mounting
from reconstruction.rotations import inverse, mean_of_sum, multiply, outer_sum
from reconstruction.skeleton import Skeleton
from reconstruction.solver import Reconstructor, SolverSettings
from reconstruction.stature import stature

SEGMENTS = {
    "thighs": ("left_lower_leg", "right_lower_leg"),
    "shins": ("left_foot", "right_foot"),
    "hips": ("left_upper_leg", "right_upper_leg"),
    "torso": ("spine", "chest", "upper_chest", "neck"),
    "head": ("head",),
    "shoulders": ("left_upper_arm", "right_upper_arm"),
    "upper arms": ("left_lower_arm", "right_lower_arm"),
    "forearms": ("left_hand", "right_hand"),
}
"""Lengths that are fitted, and the humanoid bones whose offsets each scales: left and right are alike."""

SEGMENT_SPREAD = 0.06
"""Standard deviation of a segment's share of the stature among adults, as a ratio (after Drillis and Contini, 1966)."""
STATURE_SPREAD = 0.08
"""Standard deviation of adult stature as a ratio of its mean, both sexes together."""
OFFSET_SPREAD_M = 0.03
"""Metres, standard deviation of a tracker's mounting offset on each axis."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A performer, as calibrated.

    scales: ratio of each segment's length to the database body's, by name in `SEGMENTS`; "stature" scales all.
    mounting: of the trackers. residual_cm: root mean square distance of trackers from their places on the body.
    verdict: one line on how good it is. height_m: stature; NaN where unknown. made: the day, as 2026-11-22, or "".
    """

    scales: dict[str, float]
    mounting: Mounting
    residual_cm: float
    verdict: str = ""
    height_m: float = np.nan
    made: str = ""

    def skeleton(self, body: Skeleton) -> Skeleton:
        """A body with the profile's proportions."""
        return scaled(body, self.scales)

    def write(self, path: str | Path) -> None:
        """Writes the profile as JSON, beside and renamed."""
        path = Path(path)
        beside = path.with_name(f".{path.name}.part")
        mounting = {"offsets": self.mounting.offsets.tolist(), "rotations": self.mounting.rotations.tolist()}
        known = {} if np.isnan(self.height_m) else {"height_m": self.height_m}
        what = {"scales": self.scales, "mounting": mounting, "residual_cm": self.residual_cm}
        beside.write_text(json.dumps(what | {"verdict": self.verdict, "made": self.made} | known, indent=1))
        beside.rename(path)

    @classmethod
    def read(cls, path: str | Path) -> "Profile":
        """Reads what `write` wrote. Raises FileError where it is something else."""
        try:
            what = json.loads(Path(path).read_text())
            offsets, rotations = (np.array(what["mounting"][k], np.float64) for k in ("offsets", "rotations"))
            if offsets.shape != (len(ROLES), 3) or rotations.shape != (len(ROLES), 4):
                raise ValueError
            return cls(
                {str(name): float(value) for name, value in what["scales"].items()},
                Mounting(frozen(offsets), frozen(rotations)),
                float(what["residual_cm"]),
                str(what.get("verdict", "")),
                float(what.get("height_m", np.nan)),
                str(what.get("made", "")),
            )
        except OSError as error:
            raise FileError(f"{path}: {error.strerror}") from None
        except (ValueError, KeyError, TypeError, AttributeError):
            raise FileError(f"{path}: not a performer's profile; make one with 'sixpoint calibrate'") from None


class Grade(Enum):
    """How good a calibration is."""

    GOOD = "good"
    USABLE = "usable"
    POOR = "poor"


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """What calibrating found, and how far it can be trusted.

    residuals_cm: by role seen, root mean square distance of the tracker from its place on the body;
    deviations_cm: by segment, and by role for its tracker's offset: how well the movement determined it (one
    standard deviation of the posterior); grade and verdict: the whole in a word and in a line;
    advice: a line for each thing to do better, most important first, empty where there is none;
    t_pose_s: first and last second of the T-pose that was used, or None.
    """

    profile: Profile
    residuals_cm: dict[str, float]
    deviations_cm: dict[str, float]
    grade: Grade
    verdict: str
    advice: tuple[str, ...] = ()
    t_pose_s: tuple[float, float] | None = None


def scaled(body: Skeleton, scales: dict[str, float]) -> Skeleton:
    """The body with its segments scaled; segments not named keep the stature's scale."""
    ratio = np.full(len(body), scales.get("stature", 1.0))
    for name, bones in SEGMENTS.items():
        for bone in bones:
            if bone in body.humanoid:
                ratio[body.humanoid[bone]] *= scales.get(name, 1.0)
    return replace(body, offsets=body.offsets * ratio[:, None])


def calibrate(
    frames: Sequence[TrackerFrame],
    database: MotionDatabase,
    stature_m: float | None = None,
    t_pose_s: tuple[float, float] | None = None,
    progress: Progress = no_progress,
) -> CalibrationResult:
    """The performer's body and mounting from frames of a held T-pose and some seconds of free movement.

    frames: at any rate. stature_m: the performer's height where it is known. t_pose_s: first and last second
    (`time_s` of frames) of the T-pose; where None it is looked for. Raises SettingError where fewer than half a second
    of frames have two trackers or more.
    """
    usable = [frame for frame in frames if frame.measured.sum() >= 2]
    if len(usable) < 0.5 * database.fps:
        raise SettingError(f"{len(usable)} frames with two trackers or more: calibration needs some seconds")
    body = database.space.skeleton
    profile = Profile({"stature": _first_stature(usable, database, stature_m)}, Mounting.at_the_joints(), np.inf)
    known = None if stature_m is None else profile.scales["stature"]
    for number in range(10):
        profile = _refined(profile, usable, database, body, known)
        progress(number + 1, 10)
    grade = Grade.GOOD if profile.residual_cm < 1.5 else Grade.USABLE if profile.residual_cm < 4 else Grade.POOR
    height = stature(profile.skeleton(body))
    profile = replace(profile, verdict=grade.value, height_m=height, made=date.today().isoformat())
    seen = np.any([frame.measured for frame in usable], axis=0)
    roles = [role for role, there in zip(ROLES, seen, strict=True) if there]
    unknown = dict.fromkeys((*SEGMENTS, *roles), np.nan)
    return CalibrationResult(profile, dict.fromkeys(roles, profile.residual_cm), unknown, grade, grade.value)


_NAMES = ("stature", *SEGMENTS)
_SETTINGS = SolverSettings(
    orientations=False,
    relocalise=False,
    tracker_sigma_m=0.005,
    local=LocalModelSettings(pose_floor=0.04, step_floor=1.0),
)
"""Poses by the neighbours alone: a history solved on the wrong body would agree with itself."""
_MOMENTS = 80
"""Frames whose residuals are used, spread over all."""
_INDEPENDENCE = 0.3
"""How much one of them counts, since neighbouring moments err alike."""
_FREE_ROOT_M = 0.1
"""Metres and radians: how far the root's place and facing are unknown beside what the prior says."""


def _first_stature(frames: Sequence[TrackerFrame], database: MotionDatabase, stature_m: float | None) -> float:
    """Ratio to the database's body: of statures where one is given, else of the highest head or root seen."""
    if stature_m is not None:
        return stature_m / stature(database.space.skeleton)
    seen = np.array([frame.positions[:, 1] for frame in frames])
    for role in ("head", "root"):
        heights = seen[:, ROLES.index(role)]
        heights = heights[np.isfinite(heights)]
        if len(heights):
            usual = np.percentile(database.tracks[:, ROLES.index(role), 1], 90)
            return float(np.percentile(heights, 90) / usual)
    return 1.0


def _refined(
    profile: Profile, frames: Sequence[TrackerFrame], database: MotionDatabase, body: Skeleton, known: float | None
) -> Profile:
    """One round: the poses on this profile's body, then the body that explains their residuals better."""
    solver = Reconstructor(database, profile.skeleton(body), _SETTINGS, mounting=profile.mounting)
    solver.start(frames[:1])
    every = max(1, len(frames) // _MOMENTS)
    curvature, pull, squares, turns = np.diag(_prior_precision(known)), np.zeros(len(_NAMES) + 18), [], []
    pull -= np.diag(curvature) * (_parameters(profile) - _expected(known))
    for number, frame in enumerate(frames):
        pose = solver.solve(frame).pose
        if number % every:
            continue
        effect, weight, error, off = _moment(solver, profile, body)
        curvature = curvature + _INDEPENDENCE * effect.T @ weight @ effect
        pull = pull + _INDEPENDENCE * effect.T @ weight @ error
        squares.append(np.mean(np.sum(off**2, axis=1)))
        turns.append(_turned(solver, pose, frame))
    found = _parameters(profile) + np.linalg.solve(curvature, pull)
    scales = {name: float(value) for name, value in zip(_NAMES, found, strict=False)}
    mounting = Mounting(frozen(found[len(_NAMES) :].reshape(6, 3)), frozen(_mean_turns(np.array(turns))))
    return Profile(scales, mounting, float(100 * np.sqrt(np.mean(squares))))


def _expected(known: float | None) -> NDArray[np.float64]:
    """The parameters' prior mean: the database's proportions at the known stature, trackers in the joints."""
    return np.concatenate(([1.0 if known is None else known], np.ones(len(SEGMENTS)), np.zeros(18)))


def _prior_precision(known: float | None) -> NDArray[np.float64]:
    """One over the parameters' prior variances."""
    size = STATURE_SPREAD if known is None else 0.005
    spread = [size, *[SEGMENT_SPREAD] * len(SEGMENTS), *[OFFSET_SPREAD_M] * 18]
    return np.array(spread) ** -2.0


def _parameters(profile: Profile) -> NDArray[np.float64]:
    """All that is fitted (9 + 18,): scales in the order of `_NAMES`, offsets by role."""
    return np.concatenate(([profile.scales.get(name, 1.0) for name in _NAMES], profile.mounting.offsets.ravel()))


def _moment(solver: Reconstructor, profile: Profile, body: Skeleton) -> tuple[NDArray[np.floating], ...]:
    """Of the frame just solved: what the parameters do to the trackers at the prior's mean (3 E, 27), the residuals'
    weight with the pose integrated out (3 E, 3 E), the residuals (3 E,), and those that solving left (E, 3)."""
    problem = solver.problem
    mean, points = problem.prior.mean, problem.effectors
    state = BodyState.of(len(body))
    place(problem.body, mean, state)
    error = -residuals(points, state) / np.repeat(points.weights, 3)
    j = jacobian(problem.body, points, state, len(mean)) / np.repeat(points.weights, 3)[:, None]
    spread = np.linalg.inv(problem.prior.precision)
    spread[[0, 2, 4], [0, 2, 4]] += _FREE_ROOT_M**2
    covariance = j @ spread @ j.T + np.diag(np.repeat(points.weights, 3) ** -2.0)
    effect = np.zeros((len(error), len(_NAMES) + 18))
    for number, name in enumerate(_NAMES):
        longer = profile.scales | {name: profile.scales.get(name, 1.0) + 1e-4}
        other = Body.of(solver.space.with_skeleton(scaled(body, longer)))
        moved = BodyState.of(len(body))
        raised = mean.copy()
        if name in ("stature", "thighs", "shins"):
            raised[1] *= leg_length(scaled(body, longer)) / leg_length(profile.skeleton(body))
        place(other, raised, moved)
        effect[:, number] = (moved.position[points.joints] - state.position[points.joints]).ravel() / 1e-4
    roles = [int(np.flatnonzero(solver.role_joints == joint)[0]) for joint in points.joints]
    for row, role in enumerate(roles):
        columns = slice(len(_NAMES) + 3 * role, len(_NAMES) + 3 * role + 3)
        effect[3 * row : 3 * row + 3, columns] = state.world[points.joints[row]]
    place(problem.body, solver.solved, state)
    left = residuals(points, state).reshape(-1, 3) / points.weights[:, None]
    return effect, np.linalg.inv(covariance), error, left


def _turned(solver: Reconstructor, pose: Pose, frame: TrackerFrame) -> NDArray[np.float64]:
    """`R_joint_tracker` (6, 4) of one frame, NaN where there is no orientation."""
    _, world = world_joints(solver.skeleton, pose.root_position, pose.rotations)
    joints = Rotation.from_matrix(world[solver.role_joints]).as_quat()
    return multiply(inverse(joints), frame.orientations)


def _mean_turns(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean rotations (6, 4) of (T, 6, 4) with NaN gaps; the identity where there are none."""
    out = np.tile([0.0, 0.0, 0.0, 1.0], (len(ROLES), 1))
    for role in range(len(ROLES)):
        there = turns[np.isfinite(turns[:, role, 0]), role]
        if len(there):
            out[role] = mean_of_sum(outer_sum(there))
    return out
