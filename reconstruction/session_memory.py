"""What this performer did in this session: where a lost tracker's joint was when the others were where they are now.

The database does not know how this person carries their arms; the session does. Moments in which nothing was lost are
kept, and while a tracker is lost its joint is expected where it was in the moments most like this one: as far from
the trunk's tracker as then, with the deviation that those moments show and that their distance from this one adds.
Measured on walks of unknown styles, a joint is about as far from there as the other trackers are, root mean square.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES


@dataclass(frozen=True, eq=False)
class Recollection:
    """places: (L, 3) metres, where lost joints are expected; sigma_m: (L,) standard deviations on one axis."""

    places: NDArray[np.float64]
    sigma_m: NDArray[np.float64]


class SessionMemory:
    """Keeps the last moments, each as the tracked joints' places and their ways over the frames before, (2, 6, 3)
    metres, seen from the last pose's heading frame."""

    MOMENTS = 1800
    """Half a minute."""
    FEWEST = 15
    """With fewer it remembers nothing."""
    SHARPEST_M = 0.01
    """Moments that much farther than the nearest still count about as much, ..."""
    RELATIVE = 0.2
    """... or, where the nearest is far, this share of its distance."""
    CUT = 16.0
    """Beyond that many such squares they count for nothing."""
    LEAST_M = 0.005
    """A joint's place is no surer than that."""

    def __init__(self) -> None:
        self._moments = np.empty((self.MOMENTS, 2, len(ROLES), 3), np.float32)
        self._added = 0

    def __len__(self) -> int:
        return min(self._added, self.MOMENTS)

    def add(self, moment: NDArray[np.float64]) -> None:
        """Takes in a moment (2, 6, 3) in which no tracker was lost."""
        self._moments[self._added % self.MOMENTS] = moment
        self._added += 1

    def recall(self, moment: NDArray[np.float64], here: NDArray[np.bool_], lost: NDArray[np.bool_]) -> Recollection:
        """Where lost joints are, going by those that are here.

        moment: (2, 6, 3), of which only what is here counts; here, lost: (6,). Nothing where there is too little to
        go by.
        """
        if len(self) < self.FEWEST or not here.any():
            return Recollection(np.empty((0, 3)), np.empty(0))
        squares = self._squares(moment, here)
        nearest = squares.min()
        width = self.SHARPEST_M**2 + self.RELATIVE**2 * nearest
        near = np.flatnonzero(squares < nearest + self.CUT * width)
        weights = np.exp(-0.5 * (squares[near] - nearest) / width)
        weights /= weights.sum()
        trunk = int(np.argmax(here))
        places = self._moments[near, 0].astype(np.float64)
        arms = places[:, lost] - places[:, trunk, None]
        mean = np.einsum("k,kij->ij", weights, arms)
        spread = np.einsum("k,kij->i", weights, (arms - mean) ** 2)
        sigma = np.sqrt((spread + nearest) / 3 + self.LEAST_M**2)
        return Recollection(moment[0, trunk] + mean, sigma)

    def _squares(self, moment: NDArray[np.float64], here: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Metres^2 (K,): how far the joints that are here, and their ways, are from those of each moment."""
        counted = np.broadcast_to(here[:, None], moment.shape).ravel()
        wanted = np.where(counted, moment.ravel(), 0.0).astype(np.float32)
        kept = self._moments[: len(self)].reshape(len(self), -1)
        off = kept - wanted
        off *= counted
        return np.einsum("ki,ki->k", off, off).astype(np.float64) / here.sum()
