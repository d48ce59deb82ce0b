"""Limbs one by one: what is said of a pose that is far from all whole poses of the database.

Where nobody ever stood like this, the arm may still be held as arms often are, and so may each leg: a database of
walks and throws knows more poses than it holds. So each part of the body (an arm, a leg, the head with the neck, the
trunk) is compared alone with a sample of the database, by where its own trackers are from the root's and the head's,
and the poses of the nearest become one Gaussian a part, independent of the others. A part whose tracker is missing is
as spread as in all poses.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES
from reconstruction.database import MotionDatabase
from reconstruction.gathering import gather
from reconstruction.pose_statistics import PoseStatistics
from reconstruction.prediction import Observation
from reconstruction.skeleton import Skeleton
from reconstruction.window_features import seen_from

_ROOT, _HEAD = ROLES.index("root"), ROLES.index("head")


@dataclass(frozen=True)
class LimbSettings:
    """How the nearest limbs become a Gaussian.

    count: K, how many there are, 8 or more.
    sharpness: how fast a limb's weight falls with its distance over the median distance, above 0.
    floor: radians, standard deviation added to every angle's spread, above 0.
    widening: times their own spread, above 0.
    """

    count: int = 64
    sharpness: float = 3.0
    floor: float = 0.1
    widening: float = 1.5


@dataclass(frozen=True, eq=False)
class Statement:
    """A Gaussian by its precision (D, D), which may leave coordinates free, and precision times mean (D,)."""

    precision: NDArray[np.float64]
    information: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Part:
    """One part of the body. coordinates: its own of q; roles: (R,) whose trackers tell how it is held;
    arms: (2, A) pairs of roles whose distances are compared; shapes: (n, 3 A) metres, those of the sample;
    lengths: (n,) their squares."""

    coordinates: NDArray[np.int64]
    roles: NDArray[np.int64]
    arms: NDArray[np.int64]
    shapes: NDArray[np.float64]
    lengths: NDArray[np.float64]


class LimbPoses:
    """A sample of a database, part by part."""

    SAMPLE = 3000
    """Poses, evenly spread."""

    def __init__(self, database: MotionDatabase, scale: float, all_poses: PoseStatistics, settings: LimbSettings):
        """scale: the performer's size over the database's; all_poses: of the database."""
        self._settings, self._all_poses = settings, all_poses
        rows = np.asarray(database.windows[:: max(1, len(database.windows) // self.SAMPLE)], np.int64)
        headings = np.asarray(database.headings)
        self._poses = gather(rows, 0, np.asarray(database.poses), headings)
        frames = headings[rows - 1].astype(np.float64)
        tracks = scale * seen_from(np.asarray(database.tracks)[rows].astype(np.float64), 0 * frames, frames)
        self._parts = tuple(_part(*part, tracks) for part in parts(database.space.skeleton, database.space.moving))

    def statement(self, seen: Observation, measured: float, missing: float) -> Statement:
        """What the nearest limbs say of this pose; the root's position is left free.

        measured, missing: 0 to 1, how much parts count whose trackers are there, and those whose are not.
        """
        dof = self._poses.shape[1]
        precision, information = np.zeros((dof, dof)), np.zeros(dof)
        for part in self._parts:
            here = seen.measured[part.roles].all()
            mean, covariance = self._nearest(part, seen.trackers) if here else self._any(part)
            own = np.ix_(part.coordinates, part.coordinates)
            precision[own] = (measured if here else missing) * np.linalg.inv(covariance)
            information[part.coordinates] = precision[own] @ mean
        return Statement(precision, information)

    def _nearest(self, part: _Part, trackers: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (A,) and covariance (A, A) of a part's angles where it reaches as the trackers (6, 3) do."""
        s = self._settings
        wanted = (trackers[part.arms[0]] - trackers[part.arms[1]]).ravel()
        squares = np.maximum(part.lengths - 2 * part.shapes @ wanted + wanted @ wanted, 0.0)
        near = np.argpartition(squares, s.count)[: s.count] if s.count < len(squares) else np.arange(len(squares))
        weights = np.exp(-0.5 * s.sharpness * squares[near] / max(float(np.median(squares[near])), 1e-12))
        weights /= weights.sum()
        angles = self._poses[near][:, part.coordinates]
        mean = weights @ angles
        spread = (angles - mean) * (s.widening * np.sqrt(weights))[:, None]
        return mean, spread.T @ spread + s.floor**2 * np.eye(len(mean))

    def _any(self, part: _Part) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The same of all poses."""
        own = np.ix_(part.coordinates, part.coordinates)
        floor = PoseStatistics.FLOOR**2 * np.eye(len(part.coordinates))
        return self._all_poses.mean[part.coordinates], self._all_poses.covariance[own] + floor


def _part(
    coordinates: NDArray[np.int64], roles: NDArray[np.int64], arms: NDArray[np.int64], tracks: NDArray[np.float64]
) -> _Part:
    """With the shapes of a sample's tracked joints (n, 6, 3) metres."""
    shapes = (tracks[:, arms[0]] - tracks[:, arms[1]]).reshape(len(tracks), -1)
    return _Part(coordinates, roles, arms, shapes, np.sum(shapes**2, axis=1))


def parts(
    skeleton: Skeleton, moving: NDArray[np.int32]
) -> list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    """Coordinates, roles and arms (see `_Part`) of each part that the tracked joints part a skeleton into.

    A joint belongs to the roles in its subtree, or to its parent's where there are none; the root's turn is the
    trunk's. The trunk is told by the head and the ankles seen from the root; a hand by the head too.
    """
    below = _roles_below(skeleton)
    own: dict[frozenset[int], list[int]] = {below[0]: [3, 5]}
    for number, joint in enumerate(moving):
        own.setdefault(below[joint], []).extend(range(6 + 3 * number, 9 + 3 * number))
    found = []
    for roles, coordinates in own.items():
        ends = sorted(roles)
        pairs = [(end, _ROOT) for end in ends]
        if len(ends) == 1 and ROLES[ends[0]].endswith("wrist"):
            pairs.append((ends[0], _HEAD))
        found.append((np.array(coordinates), np.array(ends), np.array(pairs).T))
    return found


def _roles_below(skeleton: Skeleton) -> list[frozenset[int]]:
    """Each joint's part, as the roles, but for the root, that hang on it."""
    hanging: list[set[int]] = [set() for _ in range(len(skeleton))]
    for role, name in enumerate(ROLES):
        joint = skeleton.role_joint(name) if role != _ROOT else -1
        while joint >= 0:
            hanging[joint].add(role)
            joint = int(skeleton.parents[joint])
    labels: list[frozenset[int]] = []
    for joint, roles in enumerate(hanging):
        labels.append(frozenset(roles) if roles else labels[int(skeleton.parents[joint])])
    return labels
