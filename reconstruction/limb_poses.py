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
    """One part of the body, in a sample of n poses.

    coordinates: (A,) its own of q; block: where they meet in (D, D);
    roles: (R,) whose trackers tell how it is held; arms: (2, P) pairs of roles, the first seen from the second;
    shapes: (n, 3 P) metres along those arms; lengths: (n,) their squares; angles: (n, A) radians;
    anyhow: the precision (A, A), and that times the mean (A,), of all poses.
    """

    coordinates: NDArray[np.int64]
    block: tuple[NDArray[np.int64], ...]
    roles: NDArray[np.int64]
    arms: NDArray[np.int64]
    shapes: NDArray[np.float64]
    lengths: NDArray[np.float64]
    angles: NDArray[np.float64]
    anyhow: tuple[NDArray[np.float64], NDArray[np.float64]]


class LimbPoses:
    """A sample of a database, part by part."""

    SAMPLE = 3000
    """Poses, evenly spread."""

    def __init__(self, database: MotionDatabase, scale: float, all_poses: PoseStatistics, settings: LimbSettings):
        """scale: the performer's size over the database's; all_poses: of the database."""
        self._settings, self._dof = settings, database.space.dof
        rows = np.asarray(database.windows[:: max(1, len(database.windows) // self.SAMPLE)], np.int64)
        headings = np.asarray(database.headings)
        poses = gather(rows, 0, np.asarray(database.poses), headings)
        tracks = scale * seen_from(np.asarray(database.tracks)[rows], headings[rows], headings[rows - 1])
        self._parts = tuple(
            _part(*part, tracks, poses, all_poses) for part in parts(database.space.skeleton, database.space.moving)
        )

    def statement(self, seen: Observation, measured: float, missing: float) -> Statement:
        """What the nearest limbs say of this pose; the root's position is left free.

        measured, missing: 0 to 1, how much parts count whose trackers are there, and those whose are not.
        """
        precision, information = np.zeros((self._dof, self._dof)), np.zeros(self._dof)
        for part in self._parts:
            here = seen.measured[part.roles].all()
            weight = measured if here else missing
            own, pull = self._nearest(part, seen.trackers) if here else part.anyhow
            precision[part.block] = weight * own
            information[part.coordinates] = weight * pull
        return Statement(precision, information)

    def _nearest(self, part: _Part, trackers: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Precision (A, A), and that times the mean (A,), of a part that reaches as the trackers (6, 3) do."""
        s = self._settings
        wanted = (trackers[part.arms[0]] - trackers[part.arms[1]]).ravel()
        squares = part.lengths - part.shapes @ (2 * wanted) + wanted @ wanted
        count = min(s.count, len(squares))
        near = np.argpartition(squares, count - 1)[:count]
        squares = squares[near]
        typical = max(np.partition(squares, count // 2)[count // 2], 1e-12)
        weights = np.exp(-0.5 * s.sharpness * squares / typical)
        weights /= weights.sum()
        angles = part.angles[near]
        mean = weights @ angles
        spread = (angles - mean) * (s.widening * np.sqrt(weights))[:, None]
        precision = np.linalg.inv(spread.T @ spread + s.floor**2 * np.eye(len(mean)))
        return precision, precision @ mean


def _part(
    coordinates: NDArray[np.int64],
    roles: NDArray[np.int64],
    arms: NDArray[np.int64],
    tracks: NDArray[np.float64],
    poses: NDArray[np.float64],
    all_poses: PoseStatistics,
) -> _Part:
    """With a sample's tracked joints (n, 6, 3) metres and poses (n, D)."""
    shapes = (tracks[:, arms[0]] - tracks[:, arms[1]]).reshape(len(tracks), -1)
    block = np.ix_(coordinates, coordinates)
    floor = PoseStatistics.FLOOR**2 * np.eye(len(coordinates))
    precision = np.asarray(np.linalg.inv(all_poses.covariance[block] + floor), np.float64)
    anyhow = precision, precision @ all_poses.mean[coordinates]
    angles = np.ascontiguousarray(poses[:, coordinates])
    return _Part(coordinates, block, roles, arms, shapes, np.sum(shapes**2, axis=1), angles, anyhow)


def parts(
    skeleton: Skeleton, moving: NDArray[np.int32]
) -> list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    """Coordinates, roles and arms (see `_Part`) of each part that the tracked joints part a skeleton into.

    A joint belongs to the roles in its subtree, or to its parent's where there are none; the root's turn is the
    trunk's. A part is told by where its roles are, seen from the root; a hand seen from the head too.
    """
    below = roles_below(skeleton)
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


def roles_below(skeleton: Skeleton) -> list[frozenset[int]]:
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
