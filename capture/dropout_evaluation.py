"""What a tracker that is lost for a while costs: its limb, the rest of the body, and the moment of its return.

Clips are held out as in `evaluation`. Each is solved once as it is, and once for each role with its tracker taken away
in the middle; both are compared with the truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.accuracy import counted_joints
from capture.evaluation import FPS, Clip, StageProgress, evenly_chosen, find_clips, kept_database, split_by_action
from capture.evaluation_runs import tracker_frames
from devices.errors import FileError
from devices.frame import TrackerFrame, TrackerState, frozen
from devices.progress import no_progress
from devices.sample import ROLES
from reconstruction.kinematics import world_joints
from reconstruction.limb_poses import roles_below
from reconstruction.motion import Motion
from reconstruction.solver import Reconstructor

RETURN_S = 0.3
"""After the tracker is back: in which the solved joint comes back to it."""
LEAD_S = 1.0
"""Least time before a gap, in which the session is got to know."""


@dataclass(frozen=True, slots=True)
class DropoutScore:
    """One gap. limb_cm, whole_cm: mean error of the limb's joints in the gap, and the same with the tracker there;
    elsewhere_cm: how much farther off the other joints are for it; back: the largest acceleration of the limb's tracked
    joint on its return over the 99th percentile of its own in the true clip."""

    clip: str
    action: str
    role: str
    limb_cm: float
    whole_cm: float
    elsewhere_cm: float
    back: float


def evaluate_dropouts(
    data: Sequence[Path],
    folder: Path,
    roles: Sequence[str],
    gap_s: float = 1.0,
    clips: int = 4,
    seconds: float = 6.0,
    stage: StageProgress | None = None,
) -> list[DropoutScore]:
    """Each role lost for `gap_s` in the middle of at most `clips` held-out clips of each action, `seconds` of each.

    The database is built into `folder`, or opened there. Raises FileError where no clip is long enough.
    """
    stage = stage or (lambda name: no_progress)
    split = split_by_action(find_clips(data))
    database = kept_database(folder / "without-held-out", split.training, False, stage("database"))
    chosen = [(clip, clip.middle(seconds)) for clip in evenly_chosen(split.held_out, clips)]
    chosen = [(clip, truth) for clip, truth in chosen if truth.duration_s > LEAD_S + gap_s + RETURN_S]
    if not chosen:
        raise FileError(
            f"no held-out clip is longer than {LEAD_S + gap_s + RETURN_S:g} s, which a gap of {gap_s:g} s needs"
        )
    scores, progress = [], stage("solving")
    for number, (clip, truth) in enumerate(chosen):
        scores += _scored(clip, truth, Reconstructor(database, truth.skeleton), roles, gap_s)
        progress(number + 1, len(chosen))
    return scores


def _scored(clip: Clip, truth: Motion, solver: Reconstructor, roles: Sequence[str], gap_s: float) -> list[DropoutScore]:
    frames = tracker_frames(truth, ROLES)
    first = max(round(LEAD_S * FPS), (len(truth) - round((gap_s + RETURN_S) * FPS)) // 2)
    gap = slice(first, first + round(gap_s * FPS))
    there = world_joints(truth.skeleton, truth.root_positions, truth.rotations)[0]
    whole = _off(there, solver.solve_take(frames).motion)
    scores = []
    for role in roles:
        solved = solver.solve_take(without(frames, role, gap)).motion
        off, limb = _off(there, solved), limb_of(truth, role)
        others = np.setdiff1d(counted_joints(truth.skeleton), limb)
        joint = truth.skeleton.role_joint(role)
        scores.append(
            DropoutScore(
                clip.path.stem,
                clip.action,
                role,
                100 * float(off[gap, limb].mean()),
                100 * float(whole[gap, limb].mean()),
                100 * float((off - whole)[gap, others].mean()),
                _jump(there[:, joint], _positions(solved)[:, joint], gap.stop),
            )
        )
    return scores


def without(frames: Sequence[TrackerFrame], role: str, gap: slice) -> list[TrackerFrame]:
    """The frames with a role's tracker missing in the gap."""
    out, column = list(frames), ROLES.index(role)
    for number in range(*gap.indices(len(frames))):
        positions, states = frames[number].positions.copy(), frames[number].states.copy()
        positions[column], states[column] = np.nan, TrackerState.MISSING
        out[number] = replace(frames[number], positions=frozen(positions), states=frozen(states))
    return out


def limb_of(motion: Motion, role: str) -> NDArray[np.int64]:
    """The joints of a role's limb that are counted: those on which, of all roles, this one alone hangs."""
    below = roles_below(motion.skeleton)
    own = [joint for joint in counted_joints(motion.skeleton) if below[joint] == {ROLES.index(role)}]
    return np.array(own or [motion.skeleton.role_joint(role)], np.int64)


def _positions(motion: Motion) -> NDArray[np.float64]:
    return world_joints(motion.skeleton, motion.root_positions, motion.rotations)[0]


def _off(there: NDArray[np.float64], solved: Motion) -> NDArray[np.float64]:
    """(T, J) metres."""
    return np.linalg.norm(_positions(solved) - there, axis=-1)


def _jump(there: NDArray[np.float64], here: NDArray[np.float64], back: int) -> float:
    """Largest acceleration of a joint (T, 3) within `RETURN_S` of frame `back`, over the true one's 99th percentile."""
    true, own = (np.linalg.norm(np.diff(path, 2, axis=0), axis=-1) for path in (there, here))
    # The second difference at i is over frames i to i + 2: the first with the returned tracker in it is back - 2.
    return float(own[back - 2 : back + round(RETURN_S * FPS)].max() / max(np.percentile(true, 99), 1e-9))


def table_of(scores: Sequence[DropoutScore]) -> str:
    """A Markdown table, a row for each action and role."""
    lines = [
        "| action | lost | gaps | limb cm, mean / worst | never lost | elsewhere, more cm | return, mean / worst |",
        "|---|---|---|---|---|---|---|",
    ]
    for action, role in dict.fromkeys((s.action, s.role) for s in scores):
        own = [s for s in scores if (s.action, s.role) == (action, role)]
        limb, back = [s.limb_cm for s in own], [s.back for s in own]
        lines.append(
            f"| {action} | {role.replace('_', ' ')} | {len(own)} | {np.mean(limb):.1f} / {max(limb):.1f} "
            f"| {np.mean([s.whole_cm for s in own]):.1f} | {np.mean([s.elsewhere_cm for s in own]):.2f} "
            f"| {np.mean(back):.2f} / {max(back):.2f} |"
        )
    return "\n".join(lines)
