"""Variable-timing transitions from any frame of one motion into another (docs/transitions.md)."""

from reconstruction.transition.classification import ClassThresholds, MotionClass
from reconstruction.transition.clip import TransitionClip, prepared
from reconstruction.transition.live import LiveTransition, clip_target, placed_under
from reconstruction.transition.methods import METHODS, transition
from reconstruction.transition.result import Transition, joined, ready_pair
from reconstruction.transition.sequence import Cue, sequence
from reconstruction.transition.timing import TimeBounds

__all__ = [
    "METHODS",
    "ClassThresholds",
    "Cue",
    "LiveTransition",
    "MotionClass",
    "TimeBounds",
    "Transition",
    "TransitionClip",
    "clip_target",
    "joined",
    "placed_under",
    "prepared",
    "ready_pair",
    "sequence",
    "transition",
]
