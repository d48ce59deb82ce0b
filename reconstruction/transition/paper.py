"""The variable-timing transition as the paper has it, with the errata that `docs/transitions.md` lists.

Y. Wang, F. Lang, Z. Wang, B. Xu, "Automatic Variable-timing Animation Transition based on Hierarchical Interpolation
Method". Equation numbers are the paper's.
"""

import numpy as np

from reconstruction.transition.classification import MotionClass
from reconstruction.transition.clip import TransitionClip
from reconstruction.transition.hierarchy import interpolated, interpolation_parameter
from reconstruction.transition.rebasing import heading_at, placed_at
from reconstruction.transition.result import Transition, between_motion, frame_count
from reconstruction.transition.root_path import gravity_factor, root_derivatives, with_gravity, with_trend
from reconstruction.transition.timing import DEFAULT_BOUNDS, TimeBounds, paper_time


def paper_transition(
    a: TransitionClip, at: int, b: TransitionClip, into: int, bounds: TimeBounds = DEFAULT_BOUNDS
) -> Transition:
    """From frame `at` of `a` into frame `into` of `b`, to the letter of the paper."""
    start = a.motion.root_positions[at]
    heading = heading_at(a, at)
    facing = placed_at(b, into, start, heading)
    time = paper_time(a, at, b, into, facing.rotations(b.motion.rotations[into, 0]), bounds)
    count = frame_count(time, a.fps)
    time = (count + 1) / a.fps
    t = np.arange(1, count + 2) / a.fps
    h = interpolation_parameter(a.motion_class, b.motion_class, t / time)
    path = _root_path(a, at, b, into, t, h)
    placement = placed_at(b, into, path[-1], heading)
    before, left = a.motion.rotations[max(at - 1, 0)], a.motion.rotations[at]
    entered, after = b.motion.rotations[into].copy(), b.motion.rotations[min(into + 1, len(b) - 1)].copy()
    entered[0], after[0] = placement.rotations(entered[0]), placement.rotations(after[0])
    rotations = interpolated(a.skeleton, before, left, entered, after, h[:-1])
    return Transition(between_motion(a, path[:-1], rotations), time, placement, "paper")


def _root_path(a: TransitionClip, at: int, b: TransitionClip, into: int, t: np.ndarray, h: np.ndarray) -> np.ndarray:
    """(N + 1, 3) the root's way to the frame entered, that frame included."""
    start = a.motion.root_positions[at]
    velocity, acceleration = root_derivatives(a.motion.root_positions, at, a.fps)
    end_height = b.motion.root_positions[into, 1]
    if MotionClass.FLIGHT in (a.motion_class, b.motion_class):
        return with_gravity(start, velocity, gravity_factor(start[1], velocity[1], end_height, t[-1]), t)
    spot = a.motion_class is b.motion_class is MotionClass.ON_THE_SPOT
    path = np.broadcast_to(start, (len(t), 3)).copy() if spot else with_trend(start, velocity, acceleration, t)
    path[:, 1] = start[1] + h * (end_height - start[1])
    return path
