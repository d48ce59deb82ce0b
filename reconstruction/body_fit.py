"""Least squares over many moments at once: segment lengths and mounting, with every moment's pose integrated out.

A moment's pose is q = mu + b + e: what similar moments of the database look like (mu), a habit of this person that all
moments share (b), and what is left (e ~ N(0, C)). Linearised at the best pose so far, its tracker residuals tell of
lengths and offsets (theta), of b, and of e; with e integrated out their covariance is S = R + J C J^T, J being the
trackers' Jacobian. What remains is one weighted linear least squares problem in (theta, b), with a prior on both,
relinearised a few times. Its inverse normal matrix is the posterior covariance, from which the deviations come.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from devices.frame import frozen
from devices.sample import ROLES
from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.database import MotionDatabase
from reconstruction.effectors import Measurement, effectors
from reconstruction.kinematics import world_joints
from reconstruction.likelihood import jacobian, residuals
from reconstruction.motion_operations import leg_length
from reconstruction.mounting import Mounting
from reconstruction.rotations import about_up, exponential, inverse, mean_of_sum, multiply, outer_sum
from reconstruction.segments import LEGS, NAMES, SEGMENTS, scaled
from reconstruction.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Moment:
    """What the trackers said at one moment, and what the database says of the pose.

    positions: (6, 3) metres and orientations: (6, 4), world, NaN where missing; heading: (3,) frame of q.
    mean: (D,) and covariance: (D, D) of q; root positions at the scale of the database's body.
    habitual: whether the person's habit b is in this pose too; weight: how much the moment counts.
    """

    positions: NDArray[np.float64]
    orientations: NDArray[np.float64]
    heading: NDArray[np.float64]
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    habitual: bool = True
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class Statement:
    """row . theta is value, give or take sigma: of the parameters (27,) alone, such as a measured height."""

    row: NDArray[np.float64]
    value: float
    sigma: float


@dataclass(frozen=True, eq=False)
class FitPrior:
    """Of theta (27,): mean and standard deviations; habit: (D,) standard deviations of b."""

    mean: NDArray[np.float64]
    spread: NDArray[np.float64]
    habit: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fit:
    """theta: (27,) scales in the order of `NAMES`, then offsets by role; turns: (6, 4) `R_joint_tracker`, NaN where no
    orientation tells; habit: (D,) b; covariance: of (theta, turns' rotation vectors, b).

    Of M moments: poses (M, D); residuals: (M, 6) metres that these leave, NaN where missing; alone: (M, 6, 3) metres
    in its joint's frame, from where the other trackers, the body and the database have a tracker; information:
    (M, 6, 3, 3) inverse of that vector's covariance; surprise: (M, 6) its length squared over what it should be, about
    1.
    """

    theta: NDArray[np.float64]
    turns: NDArray[np.float64]
    habit: NDArray[np.float64]
    covariance: NDArray[np.float64]
    poses: NDArray[np.float64]
    residuals: NDArray[np.float64]
    alone: NDArray[np.float64]
    information: NDArray[np.float64]
    surprise: NDArray[np.float64]

    @property
    def scales(self) -> dict[str, float]:
        """Of the segments."""
        return {name: float(value) for name, value in zip(NAMES, self.theta, strict=False)}

    @property
    def mounting(self) -> Mounting:
        """How the trackers sit; turned as their joints where no orientation tells."""
        unknown = np.isnan(self.turns[:, :1])
        turns = np.where(unknown, [0.0, 0.0, 0.0, 1.0], self.turns)
        return Mounting(frozen(self.theta[len(NAMES) :].reshape(len(ROLES), 3).copy()), frozen(turns))


_TAIL = 6.0
"""Degrees of freedom of the Student distribution by which a moment that does not fit counts less."""
_PARAMETERS = len(NAMES) + 3 * len(ROLES)
_BEFORE_HABIT = _PARAMETERS + 3 * len(ROLES)


@dataclass(frozen=True, eq=False)
class _Line:
    """A moment, linearised: z (n,) = effect (n, P) . change + noise of covariance S, n rows of which the first are
    positions. gain: (D, n) C J^T; factor: of S; here: (6,) roles that have a position; turned: (6, 3, 3) their joints'
    rotations, as seen from the moment's heading frame."""

    effect: NDArray[np.float64]
    z: NDArray[np.float64]
    gain: NDArray[np.float64]
    factor: tuple[NDArray[np.float64], bool]
    here: NDArray[np.bool_]
    turned: NDArray[np.float64]


class BodyFit:
    """Fits one performer. sigma_m: metres and sigma_rad: radians, standard deviations of what a tracker says."""

    def __init__(self, database: MotionDatabase, prior: FitPrior, sigma_m: float, sigma_rad: float) -> None:
        self.space, self.prior, self.sigma_m, self.sigma_rad = database.space, prior, sigma_m, sigma_rad
        self.plain = database.space.skeleton
        self.role_joints = np.array([self.plain.role_joint(role) for role in ROLES], np.int64)

    def fit(self, moments: Sequence[Moment], statements: Sequence[Statement], start: Fit | None, steps: int) -> Fit:
        """From where an earlier fit stands, or else from the prior, in some relinearisations.

        Orientations count from the step on in which the mounting's turns are known.
        """
        theta = self.prior.mean.copy() if start is None else start.theta.copy()
        habit = np.zeros(self.space.dof) if start is None else start.habit.copy()
        turns = np.full((len(ROLES), 4), np.nan) if start is None else start.turns
        poses = [self.pose_before(moment, theta, habit) for moment in moments]
        found = None
        for _ in range(steps):
            found = self._step(moments, statements, theta, turns, habit, poses)
            theta, habit, poses = found.theta, found.habit, list(found.poses)
            turns = np.where(np.isnan(found.turns), self._mean_turns(moments, poses), found.turns)
        assert found is not None
        return replace(found, turns=turns)

    def pose_before(
        self, moment: Moment, theta: NDArray[np.float64], habit: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(D,) the pose before the trackers are looked at."""
        q = moment.mean + (habit if moment.habitual else 0.0)
        q[1] += moment.mean[1] * (self.legs(theta) - 1)
        return q

    def legs(self, theta: NDArray[np.float64]) -> float:
        """Length of the legs over that of the database's body."""
        return leg_length(self.skeleton(theta)) / leg_length(self.plain)

    def skeleton(self, theta: NDArray[np.float64]) -> Skeleton:
        """The body with these parameters."""
        return scaled(self.plain, dict(zip(NAMES, theta, strict=False)))

    def _mean_turns(self, moments: Sequence[Moment], poses: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        """`R_joint_tracker` (6, 4), means over the moments, NaN where there is no orientation."""
        local = [self.space.rotations(q[None], m.heading)[0] for m, q in zip(moments, poses, strict=True)]
        _, world = world_joints(self.plain, np.zeros((len(local), 3)), np.array(local))
        out = np.full((len(ROLES), 4), np.nan)
        for role, joint in enumerate(self.role_joints):
            seen = np.array([moment.orientations[role] for moment in moments])
            there = np.isfinite(seen[:, 0])
            if there.any():
                joints = Rotation.from_matrix(world[there, joint]).as_quat()
                out[role] = mean_of_sum(outer_sum(multiply(inverse(joints), seen[there])))
        return out

    def _step(
        self,
        moments: Sequence[Moment],
        statements: Sequence[Statement],
        theta: NDArray[np.float64],
        turns: NDArray[np.float64],
        habit: NDArray[np.float64],
        poses: list[NDArray[np.float64]],
    ) -> Fit:
        """One relinearisation."""
        normal, right = self._known_before(statements, theta, habit)
        linearise = _Linearisation(self, theta, turns)
        lines = [linearise.at(m, q, habit) for m, q in zip(moments, poses, strict=True)]
        for moment, line in zip(moments, lines, strict=True):
            weighted = cho_solve(line.factor, np.column_stack((line.effect, line.z)))
            rows = len(line.z)
            trust = moment.weight * (_TAIL + rows) / (_TAIL + line.z @ weighted[:, -1])
            normal += trust * line.effect.T @ weighted[:, :-1]
            right += trust * line.effect.T @ weighted[:, -1]
        covariance = np.asarray(np.linalg.inv(normal), np.float64)
        change = covariance @ right
        theta = theta + change[:_PARAMETERS]
        habit = habit + change[_BEFORE_HABIT:]
        turned = multiply(exponential(change[_PARAMETERS:_BEFORE_HABIT].reshape(-1, 3)), turns)
        after: list[NDArray[np.float64]] = []
        by_role = []
        for moment, line in zip(moments, lines, strict=True):
            off = cho_solve(line.factor, line.z - line.effect @ change)
            after.append(self.pose_before(moment, theta, habit) + line.gain @ off)
            by_role.append(self._by_role(line, off))
        residual, alone, information, surprise = map(np.array, zip(*by_role, strict=True))
        return Fit(theta, turned, habit, covariance, np.array(after), residual, alone, information, surprise)

    def _known_before(
        self, statements: Sequence[Statement], theta: NDArray[np.float64], habit: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The normal equations of the prior and of what was stated."""
        spread = np.concatenate((self.prior.spread, np.full(3 * len(ROLES), np.pi), self.prior.habit))
        normal = np.diag(spread**-2.0)
        right = spread**-2.0 * np.concatenate((self.prior.mean - theta, np.zeros(3 * len(ROLES)), -habit))
        for statement in statements:
            row = statement.row / statement.sigma
            normal[:_PARAMETERS, :_PARAMETERS] += np.outer(row, row)
            right[:_PARAMETERS] += row * (statement.value - statement.row @ theta) / statement.sigma
        return normal, right

    def _by_role(
        self, line: _Line, off: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Residual (6,), alone (6, 3), information (6, 3, 3) and surprise (6,) of a moment (see `Fit`); off: (n,)
        S^-1 residual.

        Given all other rows, rows i are off by (S^-1)_ii^-1 (S^-1 r)_i, with covariance (S^-1)_ii^-1.
        """
        residual, surprise = np.full(len(ROLES), np.nan), np.full(len(ROLES), np.nan)
        alone, information = np.full((len(ROLES), 3), np.nan), np.full((len(ROLES), 3, 3), np.nan)
        precision = cho_solve(line.factor, np.eye(len(off)))
        for number, role in enumerate(np.flatnonzero(line.here)):
            rows = slice(3 * number, 3 * number + 3)
            residual[role] = self.sigma_m**2 * np.linalg.norm(off[rows])
            away = np.linalg.solve(precision[rows, rows], off[rows])
            surprise[role] = away @ off[rows] / 3
            alone[role] = line.turned[role].T @ away
            information[role] = line.turned[role].T @ precision[rows, rows] @ line.turned[role]
        return residual, alone, information, surprise


class _Linearisation:
    """Of moments, at one theta and mounting."""

    def __init__(self, fit: BodyFit, theta: NDArray[np.float64], turns: NDArray[np.float64]) -> None:
        self.fit, self.theta, self.turns = fit, theta, turns
        skeleton = fit.skeleton(theta)
        self.body = Body.of(fit.space.with_skeleton(skeleton))
        self.state = BodyState.of(len(skeleton))
        still = np.tile([0.0, 0.0, 0.0, 1.0], (len(ROLES), 1))
        self.mounting = Mounting(theta[len(NAMES) :].reshape(len(ROLES), 3), still)
        self.legs = fit.legs(theta)
        self.longer = np.zeros((len(NAMES), len(skeleton), 3))
        self.taller = np.zeros(len(theta))
        for number, name in enumerate(NAMES):
            more = theta.copy()
            more[number] += 1e-4
            self.longer[number] = (fit.skeleton(more).offsets - skeleton.offsets) / 1e-4
            if name in LEGS:
                self.taller[number] = (fit.legs(more) - self.legs) / 1e-4

    def at(self, moment: Moment, q: NDArray[np.float64], habit: NDArray[np.float64]) -> _Line:
        """A moment at the pose q (D,)."""
        fit, dof = self.fit, len(q)
        here = np.isfinite(moment.positions[:, 0])
        turned = here & np.isfinite(moment.orientations[:, 0]) & np.isfinite(self.turns[:, 0])
        nothing = np.full((len(ROLES), 4), np.nan)
        points = effectors(
            Measurement(moment.positions, nothing, 1.0, 1.0), fit.role_joints, self.mounting, moment.heading
        )
        place(self.body, q, self.state)
        count, rows = 3 * len(points), 3 * (len(points) + int(turned.sum()))
        error, j = np.zeros(rows), np.zeros((rows, dof))
        error[:count] = -residuals(points, self.state)
        j[:count] = jacobian(self.body, points, self.state, dof)
        effect = np.zeros((rows, _BEFORE_HABIT + dof))
        for number, role in enumerate(np.flatnonzero(here)):
            self._lengths(int(role), effect[3 * number : 3 * number + 3])
        for number, role in enumerate(np.flatnonzero(turned)):
            part = slice(count + 3 * number, count + 3 * number + 3)
            error[part] = self._turn(moment, int(role), j[part], effect[part])
        effect[:, :_PARAMETERS] += np.outer(j[:, 1], moment.mean[1] * self.taller)
        if moment.habitual:
            effect[:, _BEFORE_HABIT:] = j
        covariance = moment.covariance.copy()
        covariance[:3] *= self.legs
        covariance[:, :3] *= self.legs
        gain = covariance @ j.T
        total = j @ gain
        total[np.arange(rows), np.arange(rows)] += np.where(np.arange(rows) < count, fit.sigma_m, fit.sigma_rad) ** 2
        z = error - j @ (fit.pose_before(moment, self.theta, habit) - q)
        return _Line(effect, z, gain, cho_factor(total, lower=True), here, self.state.world[fit.role_joints])

    def _lengths(self, role: int, effect: NDArray[np.float64]) -> None:
        """Writes how lengths and offsets move a role's tracker, (3, P)."""
        world, parents = self.state.world, self.body.parents
        at = joint = int(self.fit.role_joints[role])
        while parents[at] >= 0:
            effect[:, : len(NAMES)] += world[parents[at]] @ self.longer[:, at].T
            at = int(parents[at])
        first = len(NAMES) + 3 * role
        effect[:, first : first + 3] = world[joint]

    def _turn(
        self, moment: Moment, role: int, j: NDArray[np.float64], effect: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """How far (3,) radians a tracker is turned beside its joint; writes how poses (3, D) and mounting (3, P)
        turn it. All seen from the moment's heading frame."""
        at = joint = int(self.fit.role_joints[role])
        while at >= 0:
            slot = self.body.slots[at]
            if slot >= 0:
                j[:, slot : slot + 3] = self.state.turn[at]
            at = int(self.body.parents[at])
        first = _PARAMETERS + 3 * role
        effect[:, first : first + 3] = self.state.world[joint]
        seen = Rotation.from_quat(
            multiply(about_up(np.array([-moment.heading[2]])), moment.orientations[role][None])[0]
        )
        worn = Rotation.from_matrix(self.state.world[joint]) * Rotation.from_quat(self.turns[role])
        return (seen * worn.inv()).as_rotvec()


def deviations(fit: Fit, body: Skeleton) -> dict[str, float]:
    """Metres, standard deviation of each segment's length, and of each role's offset along its least known way."""
    out = {}
    for number, (name, bones) in enumerate(SEGMENTS.items()):
        lengths = [float(np.linalg.norm(body.offsets[body.humanoid[b]])) for b in bones if b in body.humanoid]
        length = sum(lengths) / (2 if bones[0].startswith("left") else 1)
        row = np.zeros(len(fit.covariance))
        row[0], row[1 + number] = fit.theta[1 + number], fit.theta[0]
        out[name] = float(length * np.sqrt(row @ fit.covariance @ row))
    for number, role in enumerate(ROLES):
        block = slice(len(NAMES) + 3 * number, len(NAMES) + 3 * number + 3)
        out[role] = float(np.sqrt(np.linalg.eigvalsh(fit.covariance[block, block])[-1]))
    return out
