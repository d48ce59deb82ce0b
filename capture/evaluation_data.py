"""What an experiment is made of: motion files with their actions, and which of them are held out.

Clips are held out by a fixed rule: of each action's clips, sorted by name, every `HOLD_OUT`-th from the middle of the
first stretch on, and the middle one where there are fewer; the rest is the database.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from devices.errors import FileError
from reconstruction.motion import Motion
from reconstruction.motion_files import MOTION_ENDINGS, read_motion
from reconstruction.motion_operations import cropped, resampled

FPS = 60.0
HOLD_OUT = 8
ACTION_PATTERN = r"(?:cmu_(?:train|test)_|dataset-\d+_)?([A-Za-z]+(?:-[A-Za-z]+)*)"
"""What of a file's name is its action: by default its first word, data set prefixes left out."""


@dataclass(frozen=True, slots=True)
class Clip:
    """One file of the data: where it is, and what is done in it."""

    path: Path
    action: str

    def middle(self, seconds: float) -> Motion:
        """At most that many seconds from the middle of the clip, at `FPS`."""
        motion = resampled(read_motion(self.path), FPS)
        length = min(len(motion), round(seconds * FPS))
        start = (len(motion) - length) // 2
        return replace(cropped(motion, start, start + length), name=self.path.stem)


@dataclass(frozen=True, slots=True)
class Split:
    """The data parted: clips of the database, and those held out."""

    training: tuple[Clip, ...]
    held_out: tuple[Clip, ...]


def find_clips(data: Sequence[Path], action_pattern: str = ACTION_PATTERN) -> list[Clip]:
    """Motion files and all those in folders, sorted, each with its action. Raises FileError for a missing path."""
    found: list[Clip] = []
    for path in data:
        if not path.exists():
            raise FileError(f"{path}: no such file or folder")
        files = [f for f in path.rglob("*") if f.suffix.lower() in MOTION_ENDINGS] if path.is_dir() else [path]
        found += [Clip(file, _action(file, action_pattern)) for file in sorted(files)]
    return found


def split_by_action(clips: Sequence[Clip]) -> Split:
    """Holds clips out by the rule of this module. Raises FileError where nothing would be left to learn from."""
    held = []
    for same in by_action(clips).values():
        if len(same) > 1:
            held += same[min(HOLD_OUT, len(same)) // 2 :: HOLD_OUT]
    training = [clip for clip in clips if clip not in held]
    if not held or not training:
        raise FileError(f"{len(clips)} motions found; an experiment needs two of one action at least")
    return Split(tuple(training), tuple(held))


def split_off(clips: Sequence[Clip], action: str) -> Split:
    """Holds every clip of one action out. Raises FileError where that leaves none, or is none."""
    held = tuple(clip for clip in clips if clip.action == action)
    training = tuple(clip for clip in clips if clip.action != action)
    if not held or not training:
        known = ", ".join(sorted(by_action(clips)))
        raise FileError(f"action {action!r} cannot be left out; the data's actions are: {known}")
    return Split(training, held)


def evenly_chosen(clips: Iterable[Clip], most: int) -> tuple[Clip, ...]:
    """At most so many clips of each action, evenly spread where there are more."""
    chosen: list[Clip] = []
    for same in by_action(clips).values():
        places = np.unique(np.linspace(0, len(same) - 1, min(most, len(same))).round().astype(int))
        chosen += [same[place] for place in places]
    return tuple(chosen)


def by_action(clips: Iterable[Clip]) -> dict[str, list[Clip]]:
    """The clips of each action, in order."""
    found: dict[str, list[Clip]] = defaultdict(list)
    for clip in clips:
        found[clip.action].append(clip)
    return dict(found)


def _action(file: Path, pattern: str) -> str:
    try:
        found = re.match(pattern, file.stem)
    except re.error as error:
        raise FileError(f"--action {pattern!r}: not a regular expression ({error})") from None
    return (found[1] if found and found.re.groups else file.stem).lower()
