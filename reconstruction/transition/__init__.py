"""Variable-timing transitions from any frame of one motion into another (docs/transitions.md)."""

from reconstruction.transition.classification import ClassThresholds, MotionClass
from reconstruction.transition.clip import TransitionClip, prepared
from reconstruction.transition.methods import METHODS, transition
from reconstruction.transition.result import Transition, joined, ready_pair
from reconstruction.transition.sequence import Cue, sequence
from reconstruction.transition.timing import TimeBounds

__all__ = [
    "METHODS",
    "ClassThresholds",
    "Cue",
    "MotionClass",
    "TimeBounds",
    "Transition",
    "TransitionClip",
    "joined",
    "prepared",
    "ready_pair",
    "sequence",
    "transition",
]
