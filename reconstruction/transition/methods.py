"""The ways to get from one clip to another, by name."""

from collections.abc import Callable

from devices.errors import choice_error
from reconstruction.transition.clip import TransitionClip
from reconstruction.transition.natural import natural_transition
from reconstruction.transition.paper import paper_transition
from reconstruction.transition.result import Transition, ready_pair, require_frame
from reconstruction.transition.rivals import cross_fade, direct_switch, inertialised

METHODS: dict[str, Callable[[TransitionClip, int, TransitionClip, int], Transition]] = {
    "natural": natural_transition,
    "paper": paper_transition,
    "switch": direct_switch,
    "cross-fade": cross_fade,
    "inertialised": inertialised,
}
"""`natural` is the default, `paper` the paper to the letter; the others are what they are measured against."""


def transition(a: TransitionClip, at: int, b: TransitionClip, into: int = 0, method: str = "natural") -> Transition:
    """The transition from frame `at` of `a` into frame `into` of `b`, at the frame rate and on the body of `a`.

    Raises SettingError where a frame or the method does not exist or the skeletons have different joints; `into` counts
    frames of `b` at the frame rate of `a`.
    """
    if method not in METHODS:
        raise choice_error("transition method", method, METHODS)
    require_frame(a, at, "left at")
    b = ready_pair(a, b)
    require_frame(b, into, "entered at")
    return METHODS[method](a, at, b, into)
