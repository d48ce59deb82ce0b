"""What each tracker is worth at this moment: the ladder of a dropout, a smooth return, and how noisy it is."""

from collections import deque
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from devices.frame import TrackerFrame, TrackerState
from devices.sample import ROLES
from reconstruction.motion import Pose
from reconstruction.transition.live import LiveTransition
from reconstruction.transition.timing import TimeBounds


class Footing(IntEnum):
    """What a role's place in a solved pose stands on."""

    MEASURED = 0
    """A sample of this moment."""
    EXTRAPOLATED = 1
    """The last samples carried on."""
    PRIOR = 2
    """No sample: the other trackers and the database say where it is."""
    HELD = 3
    """No tracker at all for a while: the last pose is held."""


class TrackerReturn:
    """Lets a tracker that was missing come back smoothly.

    On its return the solved joint stands somewhere else and moves otherwise. Both differences, of place and, one frame
    later, of velocity, are added to what the tracker says and go to zero with quintics that end at rest.
    """

    DURATION_S = 0.3
    SLOWING_S = 0.15
    """In which the velocity is taken over: sooner, lest the pose follow its own belief for long."""
    MISSING_S = 0.07
    """A shorter gap, up to three frames, is no dropout: the track itself says how the joint went on."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forgets everything: trackers are taken as they come."""
        self._last_seen = np.full(len(ROLES), np.nan)
        self._back_since = np.full(len(ROLES), -np.inf)
        self._just_back = np.zeros(len(ROLES), np.bool_)
        self._offset, self._drift = np.zeros((2, len(ROLES), 3))

    def eased(self, frame: TrackerFrame, expected: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """The positions (6, 3) to solve for; expected: (6, 3) metres, where the pose would put them, or None."""
        here = frame.measured
        gap = frame.time_s - self._last_seen
        back = here & ~(gap <= self.MISSING_S) & (expected is not None)
        since = frame.time_s - self._back_since
        if expected is not None:
            off = expected - frame.positions
            moving = here & self._just_back & (gap > 0)
            self._drift[moving] = ((off - self._offset) / np.maximum(since, 1e-9)[:, None])[moving]
            self._back_since[back], since[back] = frame.time_s, 0.0
            self._offset[back], self._drift[back] = off[back], 0.0
        self._just_back = back
        self._last_seen[here] = frame.time_s
        place, way = _fading(since / self.DURATION_S)[0], self.SLOWING_S * _fading(since / self.SLOWING_S)[1]
        return frame.positions + place[:, None] * self._offset + way[:, None] * self._drift


class OrientationGate:
    """Lets a tracker's orientation count only where it has long been near its joint's: else its mounting is unknown."""

    PLAUSIBLE_RAD = 0.4
    """Mean angle between a tracker, as it is said to be mounted, and its joint."""
    MEMORY = 0.95
    """Share of the mean that stays from frame to frame."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forgets all trackers."""
        self._mean = np.full(len(ROLES), np.nan)

    def passed(self, orientations: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Orientations (6, 4), NaN where they shall not count; angles: (6,) radians from the joints, NaN if missing."""
        going_on = self.MEMORY * self._mean + (1 - self.MEMORY) * angles
        self._mean = np.where(np.isnan(angles), self._mean, np.where(np.isnan(self._mean), angles, going_on))
        return np.where((np.fmax(self._mean, angles) < self.PLAUSIBLE_RAD)[:, None], orientations, np.nan)


_BOUNDS = TimeBounds(0.5, 0.8)
_LONGEST_STEP_S = 1 / 30
"""A pose shown long ago, before a hold, counts as shown just now."""


class PoseEasing:
    """Shows a solver's change of mind, or its return after a hold, as a transition towards the moving pose.

    The machinery is that of the transition paper (`transition.live`): what differs fades within the time that the
    farthest joint needs.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Poses are shown as they are."""
        self._shown: Pose | None = None
        self._way: LiveTransition | None = None
        self._changed = False
        self._held = False

    def begin(self, held: bool = False) -> None:
        """The next pose does not follow from the last; held: which stood still."""
        self._changed, self._held = True, held

    def eased(self, pose: Pose) -> Pose:
        """The pose to show for a solved one."""
        if self._changed and self._shown is not None:
            self._way = LiveTransition(self._shown, None, pose, _BOUNDS, self._held)
        self._changed = False
        self._shown = self._stepped(pose)
        return self._shown

    def _stepped(self, pose: Pose) -> Pose:
        if self._way is None or self._shown is None:
            return pose
        shown = self._way.step(min(pose.time_s - self._shown.time_s, _LONGEST_STEP_S), pose)
        if self._way.done:
            self._way = None
        return shown


class NoiseMeter:
    """Estimates the trackers' noise while they run, from third differences of their positions.

    White noise of standard deviation s has third differences of deviation sqrt(20) s on each axis, much above those of
    a body that stands or moves smoothly. The lower quartile over the last second is taken, since some tracker is
    nearly always at rest.
    """

    FRAMES = 60
    _QUARTILE = 1.1 * np.sqrt(20)
    """The lower quartile of a chi distribution with three degrees of freedom, times sqrt(20)."""

    def __init__(self) -> None:
        self._positions: deque[NDArray[np.float64]] = deque(maxlen=4)
        self._jerks = np.full((self.FRAMES, len(ROLES)), np.nan)
        self._added = 0
        self.sigma_m = 0.0
        """Metres, standard deviation of a position on one axis; 0 before a quarter of a second has been seen."""

    def add(self, frame: TrackerFrame) -> None:
        """Takes in one frame."""
        measured = np.where((frame.states == TrackerState.MEASURED)[:, None], frame.positions, np.nan)
        self._positions.append(measured)
        if len(self._positions) == 4:
            a, b, c, d = self._positions
            self._jerks[self._added % self.FRAMES] = np.linalg.norm(d - 3 * c + 3 * b - a, axis=1)
            self._added += 1
            self.sigma_m = self._estimate()

    def _estimate(self) -> float:
        jerks = self._jerks[np.isfinite(self._jerks)]
        if self._added < self.FRAMES // 4 or not len(jerks):
            return 0.0
        return float(np.partition(jerks, len(jerks) // 4)[len(jerks) // 4] / self._QUARTILE)


def _fading(u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Quintics from u = 0 to rest at 0 from u = 1 on: one that starts at 1 and at rest, one that starts at 0 with slope
    1; neither is accelerated at the ends."""
    u = np.clip(u, 0, 1)
    return 1 - u**3 * (10 - 15 * u + 6 * u**2), u - u**3 * (6 - 8 * u + 3 * u**2)


def footings(frame: TrackerFrame, held: bool) -> NDArray[np.int8]:
    """(6,) `Footing` of each role in a frame."""
    out = np.where(frame.states == TrackerState.EXTRAPOLATED, Footing.EXTRAPOLATED, Footing.MEASURED)
    out = np.where(frame.measured, out, Footing.HELD if held else Footing.PRIOR)
    return out.astype(np.int8)
