"""Transitions while the target moves on: after a dropout, from idle to live, from live to a clip and back.

What is shown keeps its offset from the target at first, with its speed, and the offset fades on a quintic within a time
that varies as in the paper (eq. 3-5): joints that are far off take longer, and nothing waits for them.
"""

from collections.abc import Callable

import numpy as np

from devices.frame import frozen
from reconstruction.motion import Motion, Pose
from reconstruction.motion_operations import sampled
from reconstruction.rotations import inverse, logarithm, multiply
from reconstruction.skeleton import Skeleton
from reconstruction.transition.clip import TransitionClip, prepared
from reconstruction.transition.curves import quintic_weights, turned_by_kernel
from reconstruction.transition.rebasing import Placement, heading_at, placed_at
from reconstruction.transition.timing import TimeBounds, joint_times

LIVE_BOUNDS = TimeBounds(0.1, 0.8)
USUAL_SPEED_RAD_S = 2.5
"""How fast a joint catches up at the least; limbs in daily motion turn so fast."""
USUAL_SPEED_M_S = 1.2
"""The same for the root: a walk."""

Target = Callable[[float], Pose]
"""The pose to go to, by seconds since the transition began."""


class LiveTransition:
    """From the pose shown to a target that may move, one step at a time; a step takes some hundredths of a millisecond.

    shown: the pose last shown, and `before` the one shown before it (None: it goes along with the target). target: a
    pose to come to rest in, or what to follow; a session that solves live gives each new target to `step` instead.
    held: whether what was shown stood still, so that its offset is from where it stood to where the target is by now,
    and what is shown lies between both at every moment.
    """

    def __init__(
        self,
        shown: Pose,
        before: Pose | None,
        target: Pose | Target,
        bounds: TimeBounds = LIVE_BOUNDS,
        held: bool = False,
    ) -> None:
        self._target: Target = target if callable(target) else lambda _: target
        self._shown, self._held = shown, held
        self._offset = np.zeros((len(shown.rotations), 3))
        first = self._target(0.0)
        self._take_offset(first)
        self._rate, self._root_rate = self._rates(shown, before, first)
        self.duration_s = self._time(bounds)
        self.elapsed_s = 0.0

    @property
    def done(self) -> bool:
        """Whether what is shown is the target itself."""
        return self.elapsed_s >= self.duration_s

    def step(self, dt_s: float, target: Pose | None = None) -> Pose:
        """The pose to show `dt_s` seconds later. target: the target by then, where it is solved live."""
        self.elapsed_s += dt_s
        goal = self._target(self.elapsed_s) if target is None else target
        if self.done:
            return goal
        if self._held:
            self._take_offset(goal)
        weights = quintic_weights(np.array([self.elapsed_s]), self.duration_s)[0]
        vectors = weights[0] * self._offset + weights[1] * self._rate
        rotations = turned_by_kernel(np.array(goal.rotations), vectors[None])[0]
        root = goal.root_position + weights[0] * self._root_offset + weights[1] * self._root_rate
        return Pose(goal.time_s, frozen(root), frozen(rotations))

    def _take_offset(self, target: Pose) -> None:
        """Of what was shown from a target: (J, 3) radians and (3,) metres."""
        offset = logarithm(multiply(inverse(target.rotations), self._shown.rotations))
        # A joint that comes past half a turn away goes on the way round that it has begun.
        angle = np.linalg.norm(offset, axis=-1, keepdims=True)
        other = offset * (1 - 2 * np.pi / np.maximum(angle, 1e-9))
        farther = np.linalg.norm(offset - self._offset, axis=-1) > np.linalg.norm(other - self._offset, axis=-1)
        self._offset = np.where(farther[:, None], other, offset)
        self._root_offset = self._shown.root_position - target.root_position

    def _rates(self, shown: Pose, before: Pose | None, first: Pose) -> tuple[np.ndarray, np.ndarray]:
        """How fast the offsets change as the transition begins: (J, 3) rad/s and (3,) m/s."""
        if before is None or shown.time_s <= before.time_s:
            return np.zeros_like(self._offset), np.zeros(3)
        dt = shown.time_s - before.time_s
        earlier = self._target(-dt)
        was = logarithm(multiply(inverse(earlier.rotations), before.rotations))
        root_was = before.root_position - earlier.root_position
        # The short way round may differ from one moment to the next: a jump of a whole turn is no speed.
        rate = np.where(np.abs(self._offset - was) < np.pi / 2, (self._offset - was) / dt, 0.0)
        return rate, (self._root_offset - root_was) / dt

    def _time(self, bounds: TimeBounds) -> float:
        """Eq. 5 over all joints, and the root's way."""
        still = np.zeros_like(self._offset)
        times = joint_times(-self._offset, self._rate, still, np.full(len(self._offset), USUAL_SPEED_RAD_S))
        walk = float(np.linalg.norm(self._root_offset)) / USUAL_SPEED_M_S
        return float(np.clip(max(times.max(initial=0.0), walk), bounds.shortest_s, bounds.longest_s))


def clip_target(clip: TransitionClip, into: int, placement: Placement) -> Target:
    """What to follow where a re-based clip plays from frame `into` on; it stays at its last frame."""

    def pose(elapsed_s: float) -> Pose:
        at = np.array([into + elapsed_s * clip.fps])
        positions, rotations = sampled(clip.motion, at)
        rotations[:, 0] = placement.rotations(rotations[:, 0])
        return Pose(elapsed_s, placement.points(positions)[0], rotations[0])

    return pose


def placed_under(skeleton: Skeleton, shown: Pose, clip: TransitionClip, into: int) -> Placement:
    """The placement that puts frame `into` of the clip where the shown pose is, facing as it does."""
    here = prepared(Motion(skeleton, shown.root_position[None], shown.rotations[None], clip.fps))
    return placed_at(clip, into, shown.root_position, heading_at(here, 0))
