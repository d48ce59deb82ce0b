"""Many clips, one after the other, each left where its cue says."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from devices.errors import SettingError
from reconstruction.motion import Motion
from reconstruction.motion_operations import concatenated, cropped
from reconstruction.transition.clip import TransitionClip
from reconstruction.transition.methods import transition
from reconstruction.transition.rebasing import Placement
from reconstruction.transition.result import Transition, ready_pair


@dataclass(frozen=True, slots=True)
class Cue:
    """A clip of a sequence. into: the frame it is entered at; at: the frame it is left at, None for its last.

    Frames count at the clip's own frame rate.
    """

    clip: TransitionClip
    into: int = 0
    at: int | None = None


def sequence(cues: Sequence[Cue], method: str = "natural") -> tuple[Motion, list[Transition]]:
    """The clips of the cues with transitions between them, on the body and at the frame rate of the first.

    The first clip plays from its `into` frame, where it stands; every other is re-based. Raises SettingError.
    """
    first = cues[0].clip
    cues = [_at_home(cue, first) for cue in cues]
    parts: list[Motion] = []
    transitions: list[Transition] = []
    placement: Placement | None = None
    start = cues[0].into
    for here, following in zip(cues, [*cues[1:], None], strict=True):
        at = len(here.clip) - 1 if here.at is None else here.at
        if following is None:
            parts += _placed([cropped(here.clip.motion, min(start, at), at + 1)] if start <= at else [], placement)
            break
        step = transition(here.clip, at, following.clip, following.into, method)
        shown = [cropped(here.clip.motion, start, at + 1)] if start <= at else []
        parts += _placed([*shown, *([step.between] if len(step.between) else [])], placement)
        transitions.append(step)
        placement = step.placement if placement is None else step.placement.within(placement)
        start = following.into + step.consumed
    name = "_to_".join(cue.clip.motion.name for cue in cues[:2])
    return concatenated(parts, name), transitions


def _at_home(cue: Cue, first: TransitionClip) -> Cue:
    """The cue on the body and at the frame rate of the first clip, its frames counted anew."""
    clip = ready_pair(first, cue.clip)
    scale = clip.fps / cue.clip.fps
    last = len(clip) - 1
    into = min(round(cue.into * scale), last)
    at = None if cue.at is None else min(round(cue.at * scale), last)
    if not 0 <= cue.into < len(cue.clip):
        raise SettingError(f"entered at frame {cue.into}: {cue.clip.motion.name!r} has frames 0 to {len(cue.clip) - 1}")
    if cue.at is not None and not cue.into <= cue.at < len(cue.clip):
        raise SettingError(
            f"left at frame {cue.at}: {cue.clip.motion.name!r}, entered at frame {cue.into}, has frames up to"
            f" {len(cue.clip) - 1}"
        )
    return replace(cue, clip=clip, into=into, at=at)


def _placed(motions: list[Motion], placement: Placement | None) -> list[Motion]:
    return motions if placement is None else [placement.motion(motion) for motion in motions]
