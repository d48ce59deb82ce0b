"""Poses of the database in which trackers worn as supposed would stand as they were seen, wherever that is.

One moment is compared over a short window. What lengths and offsets may have wrong is nearly the same all through it:
so the window's mean counts as much as the trackers' places are known by now, and the movement within it in full. All
moments are laid onto all rows at once: with the floor as the complex plane, the best facing has the closed form of
`tracker_matching`, and one matrix product serves all pairs.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.body_fit import Moment
from reconstruction.body_kinematics import Body, place_kernel
from reconstruction.database import MotionDatabase
from reconstruction.default_predictor import gaussian_weights
from reconstruction.skeleton import Skeleton
from reconstruction.t_pose import floors, mean_orientations, mean_positions
from reconstruction.window_features import seen_from

MOST_ROWS = 8_000
"""Rows looked at: every so many-th of a large database."""
REACH_S = 0.15
"""Seconds from a moment to either end of its window."""
COUNT = 64
APART = 4
"""Frames that two similar rows of a clip are apart at least."""
_MEAN_S = 0.0084
"""Seconds to either side over which a tracker's readings are averaged, at least; slow trackers need half a period."""
_APART_S = 0.02
_STEPS = 3
"""Places in a window."""
FLOOR_RAD = 0.05
"""Added to the spread of every joint among the similar poses."""
SPREAD_GAIN = 2.0
"""Times the similar poses' own spread."""
TRUSTED_UNTIL = 0.4
"""Distance of the similar moments, over that at which they can be expected, from which on their spread is widened."""
FREE_ROOT = 10.0
"""Metres and radians: place and facing are anywhere."""
MOVE_SIGMA_M = 0.03
PLACE_SIGMA_M = 0.04
"""Metres: how alike two moments' movement and place can be expected to be."""
_SHARPNESS = 4.0


@dataclass(frozen=True, eq=False)
class Window:
    """positions: (3, 6, 3) metres, world, at a window's beginning, middle and end; orientations: (6, 4), world, in its
    middle, which is at time_s; NaN where missing."""

    positions: NDArray[np.float64]
    orientations: NDArray[np.float64]
    time_s: float = 0.0

    @property
    def middle(self) -> NDArray[np.float64]:
        """(6, 3) metres."""
        return self.positions[1]


def windows(frames: Sequence[TrackerFrame], most: int) -> list[Window]:
    """At most so many windows, spread over all frames, which may have any rate and pauses."""
    times = np.array([frame.time_s for frame in frames])
    half = max(_MEAN_S, 0.51 * float(np.median(np.diff(times))))
    found = []
    for middle in np.arange(times[0] + REACH_S, times[-1] - REACH_S, _APART_S):
        ends = middle + np.array([-REACH_S, 0.0, REACH_S])[:, None] + (-half, half)
        parts = [frames[first:last] for first, last in np.searchsorted(times, ends).tolist()]
        if not all(parts):
            continue
        positions = np.array([mean_positions(part) for part in parts])
        positions[:, ~np.isfinite(positions[..., 0]).all(axis=0)] = np.nan
        if np.isfinite(positions[1, :, 0]).sum() >= 2:
            found.append(Window(positions, mean_orientations(parts[1]), float(middle)))
    return [found[i] for i in np.unique(np.linspace(0, len(found) - 1, min(most, len(found))).round().astype(int))]


@dataclass(frozen=True, eq=False)
class Guess:
    """The performer as supposed so far.

    skeleton: the body; scale: of its legs against the database's; offsets: (6, 3) metres of the trackers in their
    joints' frames; habit: (D,) added to every pose of the database.
    """

    skeleton: Skeleton
    scale: float
    offsets: NDArray[np.float64]
    habit: NDArray[np.float64]


class SimilarMoments:
    """Finds them. Rows with a whole window around them, thinned evenly, are chosen once."""

    def __init__(self, database: MotionDatabase) -> None:
        self.database = database
        self.reach = max(1, round(REACH_S * database.fps))
        rows = [np.arange(c.first + self.reach, c.first + c.frames - self.reach) for c in database.clips]
        every = max(1, -(-sum(map(len, rows)) // MOST_ROWS))
        self.rows = np.concatenate(rows)[::every].astype(np.int64)
        self.clips = np.searchsorted(database.firsts, self.rows, side="right")
        around = (self.rows[:, None] + self.reach * np.arange(-1, 2)).ravel()
        self.poses = np.array(database.poses[around], np.float64)
        self.poses[:, 1] -= np.repeat(floors(database)[1][self.clips - 1], _STEPS)
        self.headings = np.asarray(database.headings[around], np.float64)
        self.role_joints = np.array([database.space.skeleton.role_joint(role) for role in ROLES], np.int64)

    def moments(self, seen: Sequence[Window], guess: Guess, unsure_m: NDArray[np.float64]) -> list[Moment]:
        """For each window its moment, by a guess of the performer.

        unsure_m: (6,) metres, how far each role's tracker may stand off where the guess has it.
        """
        model = self._model(guess)
        out: dict[int, Moment] = {}
        for group, mask, weights, squares, inner in _compared(seen, model, unsure_m):
            for column, number in enumerate(group):
                out[number] = self._moment(seen[number], model, mask, weights, squares[:, column], inner[:, column])
        return [out[number] for number in range(len(seen))]

    def misfits(
        self, candidates: Sequence[Sequence[Window]], guess: Guess, unsure_m: NDArray[np.float64]
    ) -> list[float]:
        """For each list of windows how far they are from the rows most like them, on the median."""
        model = self._model(guess)
        return [
            float(
                np.median(
                    [
                        np.sqrt(max(0.0, float(np.partition(column, 7)[:8].mean())))
                        for *_, squares, _ in _compared(seen, model, unsure_m)
                        for column in squares.T
                    ]
                )
            )
            for seen in candidates
        ]

    def _model(self, guess: Guess) -> NDArray[np.float64]:
        """Tracker positions (n, 3, 6, 3) metres in the windows of all rows, from each middle's own heading frame."""
        body = Body.of(self.database.space.with_skeleton(guess.skeleton))
        scale, habit = guess.scale, guess.habit
        q = self.poses + habit
        q[:, :3] = self.poses[:, :3] * scale
        q[:, 1] += habit[1] * scale
        points = np.empty((len(q), len(ROLES), 3))
        trackers_kernel(
            q,
            body.parents,
            body.offsets,
            body.mean,
            body.slots,
            self.role_joints,
            np.ascontiguousarray(guess.offsets),
            points,
        )
        own = self.headings * (scale, scale, 1.0)
        middle = np.repeat(own[1::3], _STEPS, axis=0)
        return seen_from(points, own, middle).reshape(-1, _STEPS, len(ROLES), 3)

    def _moment(
        self,
        window: Window,
        model: NDArray[np.float64],
        mask: NDArray[np.bool_],
        weights: NDArray[np.float64],
        squares: NDArray[np.float64],
        inner: NDArray[np.complex128],
    ) -> Moment:
        order = np.argpartition(squares, min(8 * COUNT, len(squares) - 1))[: 8 * COUNT]
        order = order[np.argsort(squares[order], kind="stable")]
        near = self._apart(order)
        weight = gaussian_weights(np.sqrt(np.maximum(squares[near], 0)), _SHARPNESS)
        poses = self.poses[3 * near + 1]
        mean = weight @ poses
        spread = (poses - mean) * np.sqrt(weight)[:, None]
        far = np.sqrt(max(0.0, float(np.median(squares[near[:8]]))) / (4 * _STEPS * mask.sum()))
        covariance = SPREAD_GAIN**2 * spread.T @ spread
        diagonal = np.arange(len(mean))
        covariance[diagonal, diagonal] += FLOOR_RAD**2
        covariance *= max(1.0, far / TRUSTED_UNTIL) ** 2
        covariance[[0, 2, 4], [0, 2, 4]] += FREE_ROOT**2
        yaw = float(np.angle(np.sum(weight * inner[near])))
        there = np.einsum("n,nri->ri", weight, model[near, 1])[mask]
        heading = _heading(there, window.middle[mask], weights, yaw)
        return Moment(window.middle, window.orientations, heading, mean, covariance)

    def _apart(self, order: NDArray[np.int64]) -> NDArray[np.int64]:
        """The best of them, none near in time to a better one."""
        kept: list[int] = []
        taken: set[tuple[int, int]] = set()
        for number in order.tolist():
            clip, part = int(self.clips[number]), int(self.rows[number]) // APART
            if (clip, part) not in taken:
                taken.add((clip, part))
                kept.append(number)
            if len(kept) == COUNT:
                break
        return np.array(kept)


def _compared(
    seen: Sequence[Window], model: NDArray[np.float64], unsure_m: NDArray[np.float64]
) -> Iterator[tuple[list[int], NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]]:
    """Windows that have the same roles together: their numbers, the roles (6,), the weights of these, the squared
    distances (n, m) of rows to windows, and the products (n, m) whose angle is the facing."""
    masks = np.array([np.isfinite(window.middle[:, 0]) for window in seen])
    for mask in np.unique(masks, axis=0):
        group = np.flatnonzero((masks == mask).all(axis=1)).tolist()
        points = np.array([seen[number].positions[:, mask] for number in group])
        weights = 1 / np.hypot(unsure_m[mask], PLACE_SIGMA_M)
        squares, inner = _squares(_features(model[:, :, mask], weights), _features(points, weights))
        yield group, mask, weights, squares, inner


def _heading(
    model: NDArray[np.float64], seen: NDArray[np.float64], weights: NDArray[np.float64], yaw: float
) -> NDArray[np.float64]:
    """x, z, yaw (3,) of the frame from which points (n, 3) lie on those seen."""
    share = weights**2 / np.sum(weights**2)
    x, _, z = share @ model
    c, s = np.cos(yaw), np.sin(yaw)
    shift = (share @ seen)[[0, 2]] - np.array([c * x + s * z, c * z - s * x])
    return np.array([shift[0], shift[1], yaw])


def _features(points: NDArray[np.float64], weights: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """On the floor, complex (n, F), and upright, real (n, F), of windows (n, 3, R, 3); weights (R,) of the mean."""
    mean = points.mean(axis=1, keepdims=True)
    share = weights**2 / np.sum(weights**2)
    centre = np.einsum("r,ntri->nti", share, mean)[:, :, None]
    centre[..., 1] = 0.0
    placed = (mean - centre) * weights[:, None]
    moving = (points - mean) / (MOVE_SIGMA_M * np.sqrt(points.shape[1]))
    features = np.concatenate((placed, moving), axis=1).reshape(len(points), -1, 3)
    return features[..., 2] + 1j * features[..., 0], features[..., 1]


def _squares(model: tuple[NDArray, NDArray], seen: tuple[NDArray, NDArray]) -> tuple[NDArray, NDArray]:
    """Least squared distances (n, m) over all facings, and the products (n, m) whose angle is the facing."""
    inner = model[0].conj() @ seen[0].T
    flat = np.sum(np.abs(model[0]) ** 2, axis=1)[:, None] + np.sum(np.abs(seen[0]) ** 2, axis=1) - 2 * np.abs(inner)
    upright = np.sum(model[1] ** 2, axis=1)[:, None] + np.sum(seen[1] ** 2, axis=1) - 2 * model[1] @ seen[1].T
    return flat + upright, inner


@njit(cache=True)
def trackers_kernel(q, parents, offsets, mean, slots, role_joints, mounted, out):
    """Tracker positions (T, 6, 3) of poses q (T, D); mounted: (6, 3) offsets in the joints' frames."""
    joints = len(parents)
    position, world, turn = np.empty((joints, 3)), np.empty((joints, 3, 3)), np.empty((joints, 3, 3))
    for t in range(len(q)):
        place_kernel(q[t], parents, offsets, mean, slots, position, world, turn)
        for role in range(len(role_joints)):
            joint = role_joints[role]
            for r in range(3):
                out[t, role, r] = position[joint, r]
                for c in range(3):
                    out[t, role, r] += world[joint, r, c] * mounted[role, c]
