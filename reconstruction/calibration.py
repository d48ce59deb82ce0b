"""Fitting a body to its trackers: segment lengths and mounting offsets from a held T-pose and free movement.

The T-pose is a pose that is known: it gives a first body at once. Then, in turns, moments of the free movement get the
poses that the database has for them on that body (`similar_moments`), and the body that explains all of them and the
T-pose together is found (`body_fit`).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.errors import FileError, SettingError
from devices.frame import TrackerFrame, frozen
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.body_fit import BodyFit, Fit, FitPrior, Moment, Statement, deviations
from reconstruction.calibration_verdict import Evidence, Grade, judged
from reconstruction.database import MotionDatabase
from reconstruction.mounting import Mounting
from reconstruction.segments import NAMES, SEGMENTS, scaled
from reconstruction.similar_moments import Guess, SimilarMoments, Window, windows
from reconstruction.skeleton import Skeleton
from reconstruction.slipping import found_slip
from reconstruction.stature import stature
from reconstruction.t_pose import TPose, found_t_pose, mean_orientations, mean_positions, t_pose
from reconstruction.tracker_matching import planar_fit
from replay_logs.atomic_file import written_beside

SEGMENT_SPREAD = 0.06
"""Standard deviation of a segment's share of the stature among adults, as a ratio (after Drillis and Contini, 1966)."""
STATURE_SPREAD = 0.10
"""Standard deviation of stature as a ratio of its mean: adults of both sexes have 0.06; some are young."""
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
        mounting = {"offsets": self.mounting.offsets.tolist(), "rotations": self.mounting.rotations.tolist()}
        known = {} if np.isnan(self.height_m) else {"height_m": self.height_m}
        what = {"scales": self.scales, "mounting": mounting, "residual_cm": self.residual_cm}
        with written_beside(Path(path)) as part:
            part.write_text(json.dumps(what | {"verdict": self.verdict, "made": self.made} | known, indent=1))

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
    if not usable or usable[-1].time_s - usable[0].time_s < 0.5:
        raise SettingError(f"{len(usable)} frames with two trackers or more: calibration needs some seconds")
    held = t_pose_s or found_t_pose(usable)
    work = _Work(database, usable, held, stature_m)
    found = work.run(progress)
    return _result(found, work, held)


_CANDOUR = 1.4
"""Times the posterior's own deviation, which takes moments for more independent than they are: by errors on made-up
bodies in motion capture (`sixpoint evaluate calibration`)."""
MOMENTS = 100
"""Moments of the free movement that are used, spread over all."""
ROUNDS = 6
_INDEPENDENCE = 0.3
"""How much a moment counts, since neighbouring ones err alike."""
_SIGMA_M = 0.004
"""Metres: what neither noise nor pose explains, such as skin and straps that move."""
_SIGMA_RAD = 0.06
"""Radians: noise of an orientation, and what straps and skin turn."""
_FLOOR_M = 0.015
"""Metres: how far the performer's floor is from the database's."""
_HABIT_RAD = 0.015
"""Radians about each axis by which a person's joints differ from the database's people all the time."""


class _Work:
    """One calibration in progress."""

    def __init__(
        self,
        database: MotionDatabase,
        frames: Sequence[TrackerFrame],
        held: tuple[float, float] | None,
        stature_m: float | None,
    ) -> None:
        self.database, self.body = database, database.space.skeleton
        self.began_s = frames[0].time_s
        self.pose = t_pose(database)
        self.similar = SimilarMoments(database)
        free = frames if held is None else [f for f in frames if not held[0] <= f.time_s <= held[1]]
        self.seen = windows(free, MOMENTS) if len(free) > 1 else []
        self.held = [] if held is None else [frame for frame in frames if held[0] <= frame.time_s <= held[1]]
        self.statements = [] if stature_m is None else [_height_statement(stature_m / stature(self.body))]
        self.start = _first_stature(frames, database) if stature_m is None else stature_m / stature(self.body)
        habit = np.full(database.space.dof, _HABIT_RAD)
        habit[[0, 2, 4]] = 1e-4
        habit[1] = _FLOOR_M
        self.prior = FitPrior(_expected(1.0 if self.held else self.start), _spreads(), habit)
        self.fit = BodyFit(database, self.prior, _SIGMA_M, _SIGMA_RAD)

    def run(self, progress: Progress) -> Fit:
        found = None
        first = [_t_pose_moment(self.held, self.pose)] if self.held else []
        if first:
            found = self.fit.fit(first, self.statements, None, 5)
        progress(1, ROUNDS + 1)
        for number in range(ROUNDS if self.seen else 0):
            moments = self._moments(found)
            found = self.fit.fit([*first, *moments], self.statements, found, 2)
            progress(number + 2, ROUNDS + 1)
        if found is None:
            raise SettingError("neither a T-pose nor movement was seen: calibration needs some seconds of them")
        return found

    def _moments(self, found: Fit | None) -> list[Moment]:
        """What the database says of every window on the body found so far."""
        theta = self.prior.mean if found is None else found.theta
        habit = np.zeros(self.database.space.dof) if found is None else found.habit
        unsure = np.full(len(ROLES), _UNSURE_M) if found is None else self._unsure(found)
        moments = self.similar.moments(self.seen, self._guess(theta, habit), unsure)
        return [replace(moment, weight=_INDEPENDENCE) for moment in moments]

    def _guess(self, theta: NDArray[np.float64], habit: NDArray[np.float64]) -> Guess:
        skeleton = self.fit.skeleton(theta)
        return Guess(skeleton, self.fit.legs(theta), theta[len(NAMES) :].reshape(len(ROLES), 3), habit)

    def swapped(self) -> tuple[str, ...]:
        """The two roles, or all of both sides, whose trackers fit clearly better the other way round; or none."""
        if not self.seen:
            return ()
        few = self.seen[:: max(1, len(self.seen) // _SWAP_MOMENTS)]
        roles = np.flatnonzero(np.isfinite([window.middle[:, 0] for window in few]).any(axis=0)).tolist()
        swaps: list[tuple[tuple[int, int], ...]] = [(), *(((a, b),) for a, b in combinations(roles, 2))]
        if set(range(2, 6)) <= set(roles):
            swaps.append(((2, 3), (4, 5)))
        guess = self._guess(_expected(self.start), np.zeros(self.database.space.dof))
        candidates = [[_exchanged(window, pairs) for window in few] for pairs in swaps]
        misfits = self.similar.misfits(candidates, guess, np.full(len(ROLES), _UNSURE_M))
        best = int(np.argmin(misfits))
        if misfits[best] > _SWAP_GAIN * misfits[0]:
            return ()
        return tuple(ROLES[role] for pair in swaps[best] for role in pair)

    def _unsure(self, found: Fit) -> NDArray[np.float64]:
        """(6,) metres by which trackers may be off."""
        first = len(NAMES)
        variance = np.diag(found.covariance)[first : first + 3 * len(ROLES)].reshape(-1, 3)
        return np.sqrt(variance.mean(axis=1))


_UNSURE_M = 0.08
"""Metres that a tracker may be off while nothing is known."""
_SWAP_MOMENTS = 12
_SWAP_GAIN = 0.75
"""What is left of the distance to the database when swapped trackers are changed back."""


def _exchanged(window: Window, pairs: Sequence[tuple[int, int]]) -> Window:
    """The window with trackers changed round."""
    order = np.arange(len(ROLES))
    for a, b in pairs:
        order[[a, b]] = order[[b, a]]
    return replace(window, positions=window.positions[:, order], orientations=window.orientations[order])


def _t_pose_moment(frames: Sequence[TrackerFrame], pose: TPose) -> Moment:
    """The T-pose as a moment: its place and facing by the trackers' own."""
    positions = mean_positions(frames)
    here = np.isfinite(positions[:, 0])
    heading = planar_fit(pose.trackers[here], positions[here])
    spread = np.diag(pose.spread**2)
    return Moment(positions, mean_orientations(frames), heading, pose.q, spread, habitual=False)


def _first_stature(frames: Sequence[TrackerFrame], database: MotionDatabase) -> float:
    """Ratio to the database's body by the highest head or root seen; 1 where neither is."""
    seen = np.array([frame.positions[:, 1] for frame in frames])
    for role in ("head", "root"):
        heights = seen[:, ROLES.index(role)]
        heights = heights[np.isfinite(heights)]
        if len(heights):
            usual = np.percentile(database.tracks[:, ROLES.index(role), 1], 90)
            return float(np.percentile(heights, 90) / usual)
    return 1.0


def _expected(size: float) -> NDArray[np.float64]:
    """(27,) the parameters' prior mean: the database's proportions, trackers in the joints."""
    return np.concatenate(([size], np.ones(len(SEGMENTS)), np.zeros(3 * len(ROLES))))


def _spreads() -> NDArray[np.float64]:
    """(27,) the parameters' prior standard deviations."""
    lengths = [STATURE_SPREAD, *[SEGMENT_SPREAD] * len(SEGMENTS)]
    return np.array([*lengths, *[OFFSET_SPREAD_M] * (3 * len(ROLES))])


_SHARES = {"shins": 0.246, "thighs": 0.235, "torso": 0.288, "head": 0.05}
"""Of the stature, as `standard_body` has it; the rest, feet and skull, goes with the stature."""


_HEIGHT_ROW = np.array([1.0, *(_SHARES.get(name, 0.0) for name in SEGMENTS), *np.zeros(3 * len(ROLES))])
"""What the parameters do to the height: the segments that stand on each other, to first order."""


def _height_statement(ratio: float) -> Statement:
    """A measured height, over that of the database's body."""
    return Statement(_HEIGHT_ROW, ratio + sum(_SHARES.values()), 0.01)


def _result(found: Fit, work: _Work, held: tuple[float, float] | None) -> CalibrationResult:
    """In a person's units, and judged."""
    height = stature(work.body) * (float(_HEIGHT_ROW @ found.theta) - sum(_SHARES.values()))
    seen = np.asarray(np.isfinite(found.residuals).any(axis=0))
    roles = [role for role, there in zip(ROLES, seen, strict=True) if there]
    left = 100 * np.sqrt(np.nanmean(found.residuals[:, seen] ** 2, axis=0))
    known = {name: 100 * _CANDOUR * value for name, value in deviations(found, work.body).items()}
    slip = found_slip(found, [window.time_s - work.began_s for window in work.seen])
    evidence = Evidence(
        found, work.database.space, height, known, roles, work.swapped(), len(work.seen), bool(work.held), slip
    )
    judgement = judged(evidence)
    whole = float(np.sqrt(np.mean(left**2)))
    today = date.today().isoformat()
    profile = Profile(found.scales, found.mounting, whole, judgement.verdict, height, today)
    residuals = dict(zip(roles, left.tolist(), strict=True))
    return CalibrationResult(profile, residuals, known, judgement.grade, judgement.verdict, judgement.advice, held)
