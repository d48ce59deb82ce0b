"""Style-based inverse kinematics: Grochow, Martin, Hertzmann and Popović, SIGGRAPH 2004.

A pose model is learned once from a spread-out active set of the database. Each frame looks for the latent x whose
pose, laid onto the floor where the trackers want it, explains them (their eq. 9, L_IK), and the pose is solved about
it. Their features' velocities are left out; a gentle pull to the last pose keeps the motion together instead.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from devices.sample import ROLES
from reconstruction.baselines.gplvm import learned, spread_out
from reconstruction.body_kinematics import Body, BodyState, place
from reconstruction.database import MotionDatabase
from reconstruction.map_problem import GaussianPrior
from reconstruction.prediction import Observation, Prediction, SolvedPose
from reconstruction.tracker_matching import planar_fit

_ON_THE_FLOOR = np.array([0, 2, 4])
"""Places in q of the root's x, z and (near enough, tilts being small) yaw: where on the floor, no part of the style."""


class StyleIkPredictor:
    """The GPLVM's Gaussian about the pose of the best latent point."""

    ACTIVE = 300
    LATENT = 5
    TRACKER_SIGMA = 0.015
    """Metres: how near a latent pose's tracked joints are asked to come before the pose itself is solved."""
    SMOOTH = 0.1
    """Radians: how far, for the latent point, a frame's pose may lie from the last one's."""
    FLOOR_DEVIATION = 0.05
    """Metres and radians: how far the root may stand and turn from where the latent pose was laid."""
    LEAST_DEVIATION = 0.03
    """Radians (metres): how sure of a degree of freedom the model may be at most."""
    CLEARLY = 10.0
    """By how much another start must lower L_IK before the last latent point is left."""
    STEPS = 8
    """L-BFGS steps of the latent search a frame."""

    def __init__(self, database: MotionDatabase, scale: float, roles: Sequence[str], seed: int = 0):
        """scale: the performer's size over the database's; roles: the trackers there are; seed: of the pose sample."""
        self._scale = scale
        self._columns = [ROLES.index(role) for role in roles]
        self._joints = [database.space.skeleton.role_joint(role) for role in roles]
        self._body, self._state = Body.of(database.space), BodyState.of(len(database.space.skeleton))
        sample = np.random.default_rng(seed).choice(len(database), min(len(database), 12_000), replace=False)
        poses = np.asarray(database.poses)[np.sort(sample)].astype(np.float64)
        self._free = np.setdiff1d(np.arange(poses.shape[1]), _ON_THE_FLOOR)
        active = poses[spread_out(poses[:, self._free], self.ACTIVE)]
        self._model = learned(active[:, self._free], self.LATENT)
        self._tracked = np.array([self._placed(y) for y in active[:, self._free]])
        self._latent: NDArray[np.float64] | None = None

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        """See `Predictor`."""
        wanted = seen.trackers[self._columns] / self._scale
        last = past[-1].q[self._free]
        best = self._start(wanted, last)
        found = minimize(
            self._energy, best, (wanted, last), method="L-BFGS-B", options={"maxiter": self.STEPS, "ftol": 1e-5}
        )
        self._latent = found.x
        return Prediction(self._prior(found.x, wanted), np.zeros(0, np.int64), 1.0)

    def _start(self, wanted: NDArray[np.float64], last: NDArray[np.float64]) -> NDArray[np.float64]:
        """The last latent point, or, where one is clearly better, that of an active pose that fits the trackers."""
        errors = [_misfit(joints, wanted) for joints in self._tracked]
        starts = [self._model.latents[k] for k in np.argsort(errors)[:3]]
        energies = [self._energy(x, wanted, last) for x in starts]
        best = int(np.argmin(energies))
        if self._latent is not None and self._energy(self._latent, wanted, last) < energies[best] + self.CLEARLY:
            return self._latent
        return starts[best]

    def _energy(self, latent: NDArray[np.float64], wanted: NDArray[np.float64], last: NDArray[np.float64]) -> float:
        """L_IK of a latent point (Q,): trackers, variance, latent prior, and nearness to the last pose."""
        pose, variance = self._model.pose(latent)
        misfit = _misfit(self._placed(pose), wanted) / self.TRACKER_SIGMA**2
        apart = float(np.mean((pose - last) ** 2)) / self.SMOOTH**2
        return 0.5 * (misfit + apart + len(pose) * np.log(variance) + latent @ latent)

    def _prior(self, latent: NDArray[np.float64], wanted: NDArray[np.float64]) -> GaussianPrior:
        pose, variance = self._model.pose(latent)
        x, z, yaw = planar_fit(self._placed(pose), wanted)
        mean, precision = np.empty(len(pose) + 3), np.empty(len(pose) + 3)
        mean[self._free] = pose
        precision[self._free] = 1 / (variance / self._model.weights**2 + self.LEAST_DEVIATION**2)
        mean[_ON_THE_FLOOR], precision[_ON_THE_FLOOR] = (x, z, yaw), self.FLOOR_DEVIATION**-2
        mean[:3] *= self._scale
        return GaussianPrior(mean, np.diag(precision))

    def _placed(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tracked joints (n, 3) metres of a pose without its place on the floor."""
        q = np.zeros(len(pose) + 3)
        q[self._free] = pose
        place(self._body, q, self._state)
        return self._state.position[self._joints].copy()


def _misfit(joints: NDArray[np.float64], wanted: NDArray[np.float64]) -> float:
    """Sum of squared distances, metres^2, once joints (n, 3) are laid onto the trackers (n, 3) along the floor."""
    a, b = joints - joints.mean(axis=0), wanted - wanted.mean(axis=0)
    along = np.sum(a[:, 0] * b[:, 0] + a[:, 2] * b[:, 2])
    across = np.sum(a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2])
    level = np.sum(a[:, [0, 2]] ** 2) + np.sum(b[:, [0, 2]] ** 2) - 2 * np.hypot(along, across)
    return float(level + np.sum((joints[:, 1] - wanted[:, 1]) ** 2))
