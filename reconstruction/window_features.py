"""What makes two moments alike: the last movement of the whole body, and where the trackers are now.

Both are seen from the heading frame of the pose before, and both are in metres, so that one Euclidean distance over
them is a root mean square distance between points of two bodies.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES

SPAN = 3
"""Frames that a window's history reaches back: the paper's m."""


@dataclass(frozen=True, eq=False)
class WindowFeatures:
    """Projects windows to feature vectors of F = P + 18 numbers.

    turn_weight: metres; how far off a joint counts that is turned one radian too far.
    velocity_weight: how much a joint's way over the history counts against its position.
    tracker_weight: how much the trackers' root mean square distance counts against the history's.
    mean: (H,) and basis: (P, H), the principal components of the history of a database.
    """

    turn_weight: float
    velocity_weight: float
    tracker_weight: float
    mean: NDArray[np.float32]
    basis: NDArray[np.float32]

    TURN_WEIGHT = 0.2
    VELOCITY_WEIGHT = 1.0
    TRACKER_WEIGHT = 1.5
    COMPONENTS = 24

    @property
    def size(self) -> int:
        """F."""
        return len(self.basis) + 3 * len(ROLES)

    @classmethod
    def fitted(cls, turns: NDArray, last: NDArray, earlier: NDArray) -> "WindowFeatures":
        """From the histories, as `features` takes them, of a sample of a database's windows."""
        history = _history(turns, last, earlier, cls.TURN_WEIGHT, cls.VELOCITY_WEIGHT)
        mean = history.mean(axis=0)
        vectors = np.linalg.eigh((history - mean).T @ (history - mean))[1]
        basis = np.ascontiguousarray(vectors[:, ::-1][:, : cls.COMPONENTS].T, np.float32)
        return cls(cls.TURN_WEIGHT, cls.VELOCITY_WEIGHT, cls.TRACKER_WEIGHT, mean.astype(np.float32), basis)

    def features(self, turns: NDArray, last: NDArray, earlier: NDArray, trackers: NDArray) -> NDArray[np.float32]:
        """(n, F) of windows, all seen from the heading frame of the pose one frame ago.

        turns: (n, D - 3) radians, q of that pose without the root's position; last, earlier: (n, J, 3) metres, joint
        positions one and `SPAN` frames ago; trackers: (n, 6, 3) metres, the tracked joints now.
        """
        history = _history(turns, last, earlier, self.turn_weight, self.velocity_weight)
        near = (history - self.mean) @ self.basis.T
        now = self.tracker_weight / np.sqrt(len(ROLES)) * trackers.reshape(len(trackers), -1)
        return np.concatenate((near, now), axis=1).astype(np.float32)


def _history(
    turns: NDArray, last: NDArray, earlier: NDArray, turn_weight: float, velocity_weight: float
) -> NDArray[np.float64]:
    """(n, H) metres: squared distances are mean squares over the joints."""
    ways = velocity_weight * (last - earlier)
    parts = [turn_weight * turns, last.reshape(len(last), -1), ways.reshape(len(last), -1)]
    return np.concatenate(parts, axis=1, dtype=np.float64) / np.sqrt(last.shape[1])


def seen_from(points: NDArray, own: NDArray, other: NDArray) -> NDArray[np.float64]:
    """Points (n, P, 3) given in heading frames `own` (n, 3), as seen from the heading frames `other` (n, 3)."""
    turn, back = own[:, 2] - other[:, 2], other[:, 2]
    dx, dz = (own[:, :2] - other[:, :2]).astype(np.float64).T
    cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]
    c, s = np.cos(back), np.sin(back)
    x, z = points[..., 0], points[..., 2]
    out = np.empty(points.shape)
    out[..., 0] = cosine * x + sine * z + (c * dx - s * dz)[:, None]
    out[..., 1] = points[..., 1]
    out[..., 2] = cosine * z - sine * x + (c * dz + s * dx)[:, None]
    return out
