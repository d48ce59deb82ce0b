"""What is shown: the performer, idling, or a clip; and the way from one to the other without a seam."""

import threading
from enum import StrEnum

import numpy as np

from deformation.retarget import Retargeter
from reconstruction.motion import Motion, Pose
from reconstruction.motion_library import actions
from reconstruction.motion_library.actions import play
from reconstruction.skeleton import Skeleton
from reconstruction.transition import LiveTransition, TransitionClip, clip_target, placed_under, prepared
from reconstruction.transition.live import Target

_IDLE_SEED = 4
_IDLE_STATURE_M = 1.75


class Act(StrEnum):
    """What can be shown."""

    LIVE = "live"
    IDLE = "idle"
    CLIP = "clip"


class Director:
    """Begins idling, goes live with the first solved pose, and changes between acts when asked, from any thread.

    idle, clip: motions on the performer's skeleton; without a clip `Act.CLIP` idles. A clip that has ended goes live.
    """

    def __init__(self, skeleton: Skeleton, idle: Motion, clip: Motion | None = None) -> None:
        self._skeleton = skeleton
        self._clips = {Act.IDLE: prepared(idle), Act.CLIP: prepared(clip or idle)}
        self._asked = Act.LIVE
        self._lock = threading.Lock()
        self.reset()

    def reset(self) -> None:
        """Idles again until the next pose."""
        self.act = Act.IDLE
        self._shown: Pose | None = None
        self._before: Pose | None = None
        self._way: LiveTransition | None = None
        self._lived: tuple[Pose, Pose] | None = None

    def ask(self, act: Act) -> None:
        """The act to change to with the next pose."""
        with self._lock:
            self._asked = act

    def toggle_clip(self) -> None:
        """From the clip to the performer, from anything else to the clip."""
        with self._lock:
            self._asked = Act.LIVE if self._asked is Act.CLIP else Act.CLIP

    def shown(self, live: Pose) -> Pose:
        """The pose to show for the performer's newest one."""
        if self._shown is None:
            self._shown = self._idling_under(live)
        with self._lock:
            asked = self._asked
        if asked is not self.act:
            self._change(asked, live)
        pose = self._next(live)
        self._before, self._shown = self._shown, pose
        self._lived = (live, self._lived[0] if self._lived else live)
        return pose

    def _next(self, live: Pose) -> Pose:
        if self._way is None or self._shown is None:
            return live
        way, elapsed_s = self._way, max(live.time_s - self._shown.time_s, 0.0)
        pose = way.step(elapsed_s, live if self.act is Act.LIVE else None)
        if self.act is Act.LIVE and way.done:
            self._way = None
        if self.act is Act.CLIP and way.elapsed_s > self._clips[Act.CLIP].motion.duration_s:
            self.ask(Act.LIVE)
        return Pose(live.time_s, pose.root_position, pose.rotations)

    def _change(self, act: Act, live: Pose) -> None:
        assert self._shown is not None
        self.act = act
        target = self._performer(live) if act is Act.LIVE else self._following(self._clips[act], self._shown)
        self._way = LiveTransition(self._shown, self._before, target)

    def _performer(self, live: Pose) -> Target:
        """The performer when the last pose was shown, and before: so that the way begins with the speed it had."""
        last, earlier = self._lived or (live, live)
        return lambda elapsed_s: earlier if elapsed_s < 0 else last

    def _following(self, clip: TransitionClip, under: Pose) -> Target:
        return clip_target(clip, 0, placed_under(self._skeleton, under, clip, 0))

    def _idling_under(self, live: Pose) -> Pose:
        pose = self._following(self._clips[Act.IDLE], live)(0.0)
        return Pose(live.time_s, pose.root_position, pose.rotations)


def make_director(skeleton: Skeleton, reference: Pose, clip: Motion | None = None) -> Director:
    """A director for that performer. reference: a pose that stands, for skeletons whose rest pose is none.

    The idling is our own library's; a clip on other joints is carried over. Raises SixpointError where that cannot be.
    """
    rng = np.random.default_rng(_IDLE_SEED)
    idle = play(actions.idle(rng), _IDLE_STATURE_M, rng, "idle")
    idle = Retargeter(idle.skeleton, skeleton, target_reference=reference).motion(idle)
    if clip is not None and not clip.skeleton.same_tree(skeleton):
        clip = Retargeter(clip.skeleton, skeleton, clip.pose(0), reference).motion(clip)
    director = Director(skeleton, idle, clip)
    for number in range(2):  # kernels are loaded now, not in the first frames
        director.shown(Pose(number / 60, reference.root_position, reference.rotations))
    director.reset()
    return director
