"""What makes two moments alike: the last movement of the whole body, and where the trackers are now.

Both are seen from the heading frame of the pose before, and both are in metres, so that one Euclidean distance over
them is a root mean square distance between points of two bodies.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES


@dataclass(frozen=True, eq=False)
class WindowFeatures:
    """Projects windows to feature vectors of F = P + 18 numbers.

    mean: (2 J 3,) and basis: (P, 2 J 3), the principal components of the history of a database.
    """

    mean: NDArray[np.float32]
    basis: NDArray[np.float32]

    SPAN = 3
    """Frames that the history reaches back: the paper's m."""
    VELOCITY_WEIGHT = 1.0
    """A joint's way over `SPAN` frames counts this much against its position."""
    TRACKER_WEIGHT = 1.5
    """The trackers' root mean square distance counts this much against the history's."""
    COMPONENTS = 24

    @property
    def size(self) -> int:
        """F."""
        return len(self.basis) + 3 * len(ROLES)

    @classmethod
    def fitted(cls, history: NDArray[np.float32]) -> "WindowFeatures":
        """From histories (n, 2 J 3) of a sample of a database's windows."""
        mean = history.mean(axis=0, dtype=np.float64)
        centred = history - mean
        vectors = np.linalg.eigh(centred.T @ centred)[1]
        basis = vectors[:, ::-1][:, : cls.COMPONENTS].T
        return cls(mean.astype(np.float32), np.ascontiguousarray(basis, np.float32))

    @classmethod
    def history(cls, last: NDArray, earlier: NDArray) -> NDArray[np.float32]:
        """(n, 2 J 3) metres, of joint positions (n, J, 3) one and `SPAN` frames ago in the last one's heading frame."""
        both = np.stack((last, cls.VELOCITY_WEIGHT * (last - earlier)), axis=1)
        return (both / np.sqrt(last.shape[1])).reshape(len(last), -1).astype(np.float32)

    def features(self, history: NDArray[np.float32], trackers: NDArray) -> NDArray[np.float32]:
        """(n, F) of histories (n, 2 J 3) and tracked joints (n, 6, 3) metres now, in the last pose's heading frame."""
        weight = self.TRACKER_WEIGHT / np.sqrt(len(ROLES))
        near = (history - self.mean) @ self.basis.T
        return np.concatenate((near, weight * trackers.reshape(len(trackers), -1)), axis=1).astype(np.float32)


def seen_from(points: NDArray, own: NDArray, other: NDArray) -> NDArray[np.float64]:
    """Points (n, P, 3) given in heading frames `own` (n, 3), as seen from the heading frames `other` (n, 3)."""
    turned = _about_up(points, own[:, 2] - other[:, 2])
    ground = np.zeros((len(points), 1, 3))
    ground[:, 0, [0, 2]] = own[:, :2] - other[:, :2]
    return turned + _about_up(ground, -other[:, 2])


def _about_up(points: NDArray, yaw: NDArray) -> NDArray[np.float64]:
    """Points (n, P, 3) turned by yaw (n,) about +Y."""
    cosine, sine = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack((cosine * x + sine * z, y, cosine * z - sine * x), axis=-1)
