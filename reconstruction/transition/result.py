"""What a transition is, and the motion that it makes of two clips."""

from dataclasses import dataclass, replace

import numpy as np

from devices.errors import SettingError
from devices.frame import frozen
from reconstruction.motion import Motion
from reconstruction.motion_operations import concatenated, cropped, retargeted, same_rate
from reconstruction.transition.clip import TransitionClip, prepared
from reconstruction.transition.rebasing import Placement


@dataclass(frozen=True, eq=False, slots=True)
class Transition:
    """The frames between the frame left and the frame entered, neither of them included.

    between: N frames, N may be 0; duration_s: from the frame left to the frame entered, (N + 1) / fps.
    placement: where the next clip goes. consumed: frames of the next clip that `between` already shows (rivals blend
    while it plays; a transition proper shows none).
    """

    between: Motion
    duration_s: float
    placement: Placement
    method: str
    consumed: int = 0


def joined(a: TransitionClip, at: int, transition: Transition, b: TransitionClip, into: int) -> Motion:
    """Clip `a` up to frame `at`, the transition, and clip `b` from frame `into`, re-based."""
    parts = [cropped(a.motion, 0, at + 1)]
    if len(transition.between):
        parts.append(transition.between)
    start = into + transition.consumed
    if start < len(b):
        parts.append(transition.placement.motion(cropped(b.motion, start, len(b))))
    return concatenated(parts, f"{a.motion.name}_to_{b.motion.name}")


def seam(a: TransitionClip, at: int, transition: Transition, b: TransitionClip, into: int, margin: int) -> Motion:
    """`joined`, but only the transition and `margin` frames before and after it, where the clips have so many."""
    start, stop = max(at - margin, 0), into + transition.consumed + margin
    return joined(_cut(a, start, at + 1), at - start, transition, _cut(b, 0, min(stop, len(b))), into)


def _cut(clip: TransitionClip, start: int, stop: int) -> TransitionClip:
    return replace(clip, motion=cropped(clip.motion, start, stop))


def ready_pair(a: TransitionClip, b: TransitionClip) -> TransitionClip:
    """`b` on the body and at the frame rate of `a`. Raises SettingError naming the joints where skeletons differ."""
    if b.skeleton is a.skeleton and same_rate(b.motion, a.motion):
        return b
    same_body = b.skeleton.same_tree(a.skeleton) and np.array_equal(b.skeleton.offsets, a.skeleton.offsets)
    if not same_body:
        b = prepared(retargeted(b.motion, a.skeleton), b.thresholds)
    return b.at_rate(a.fps)


def require_frame(clip: TransitionClip, frame: int, what: str) -> None:
    """Raises SettingError where the clip has no such frame."""
    if not 0 <= frame < len(clip):
        raise SettingError(f"{what} frame {frame}: {clip.motion.name!r} has frames 0 to {len(clip) - 1}")


def between_motion(a: TransitionClip, positions: np.ndarray, rotations: np.ndarray) -> Motion:
    """The frames of a transition on the body of `a`."""
    return Motion(a.skeleton, frozen(positions), frozen(rotations), a.fps, "transition")


def frame_count(duration_s: float, fps: float) -> int:
    """How many frames stand between the frame left and the frame entered: T in whole frames, at least one step."""
    return max(round(duration_s * fps), 1) - 1
