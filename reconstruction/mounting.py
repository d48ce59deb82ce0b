"""How trackers sit on a body: where from the joint, and which way."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.frame import frozen
from devices.sample import ROLES
from reconstruction.rotations import inverse, multiply


@dataclass(frozen=True, eq=False)
class Mounting:
    """One row a role in the order of `ROLES`.

    offsets: (6, 3) metres, from the role's joint to the tracker, in the joint's frame;
    rotations: (6, 4) unit quaternions (x, y, z, w), `R_joint_tracker`.
    """

    offsets: NDArray[np.float64]
    rotations: NDArray[np.float64]

    @classmethod
    def at_the_joints(cls) -> "Mounting":
        """Trackers that sit in the joints and are turned as these."""
        still = np.tile([0.0, 0.0, 0.0, 1.0], (len(ROLES), 1))
        return cls(frozen(np.zeros((len(ROLES), 3))), frozen(still))

    def joint_rotations(self, orientations: NDArray[np.float64]) -> NDArray[np.float64]:
        """`R_world_joint` (6, 4) of tracker orientations (6, 4); NaN where there is none."""
        return multiply(orientations, inverse(self.rotations))

    def arms(self, turns: NDArray[np.float64]) -> NDArray[np.float64]:
        """The ways (6, 3) metres from joints to trackers for joints turned by `turns` (6, 3, 3)."""
        return np.einsum("rij,rj->ri", turns, self.offsets)
