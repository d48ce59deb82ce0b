"""What a changed setting does to the poses of takes: solved both ways, the differences by joint and over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.accuracy import counted_joints
from capture.solve_settings import SolveSettings, apply_settings
from capture.solving import SolvedTake, solve_with
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.database import MotionDatabase
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_operations import require_same_joints, resampled
from reconstruction.rotations import inverse, logarithm, multiply

__all__ = ["Comparison", "apply_settings", "compare", "jitter_m_s3"]


@dataclass(frozen=True, eq=False)
class Comparison:
    """One take, solved before and after a change of settings.

    degrees: (T, J) between the local rotations of the compared joints. centimetres: (T, J) between their places in the
    world. Row t is at t / fps seconds; where the rates differ, the change is looked at at the times of what was before.
    tracked: which of the joints have trackers.
    """

    take: str
    before: SolvedTake
    after: SolvedTake
    fps: float
    joints: tuple[str, ...]
    tracked: tuple[int, ...]
    degrees: NDArray[np.float64]
    centimetres: NDArray[np.float64]

    def figures(self) -> dict:
        """What the change does, as plain values: of each solution, and between them."""
        worst = np.unravel_index(int(np.argmax(self.centimetres)), self.centimetres.shape)
        return {
            "take": self.take,
            "before": solution_figures(self.before),
            "after": solution_figures(self.after),
            "difference": {
                "degrees_mean": _rounded(self.degrees.mean()),
                "degrees_p95": _rounded(np.percentile(self.degrees, 95)),
                "degrees_max": _rounded(self.degrees.max()),
                "cm_mean": _rounded(self.centimetres.mean()),
                "cm_p95": _rounded(np.percentile(self.centimetres, 95)),
                "cm_max": _rounded(self.centimetres.max()),
                "cm_max_joint": self.joints[worst[1]],
                "cm_max_at_s": _rounded(worst[0] / self.fps),
                "cm_tracked_mean": _rounded(self.centimetres[:, list(self.tracked)].mean()),
            },
            "by_joint": {
                name: {"degrees_mean": _rounded(d.mean()), "cm_mean": _rounded(c.mean()), "cm_max": _rounded(c.max())}
                for name, d, c in zip(self.joints, self.degrees.T, self.centimetres.T, strict=True)
            },
        }

    def over_time(self) -> dict[str, list[float]]:
        """Means over joints for each frame, and the coverage of both, as plain lists."""
        sides = {"before": self.before, "after": self.after}
        coverage = {f"coverage_{name}": _plain(side.reconstruction.coverage) for name, side in sides.items()}
        return {
            "time_s": _plain(np.arange(len(self.degrees)) / self.fps),
            "degrees": _plain(self.degrees.mean(axis=1)),
            "cm": _plain(self.centimetres.mean(axis=1)),
            **coverage,
        }


def compare(
    take: Path,
    before: SolveSettings,
    after: SolveSettings,
    databases: tuple[MotionDatabase, MotionDatabase],
    progress: Progress = no_progress,
) -> Comparison:
    """Solves a take both ways, each with its database.

    Raises FileError and SettingError as solving does, and where the two databases' joints differ.
    """
    first = solve_with(take, databases[0], before, lambda done, total: progress(done, 2 * total))
    second = solve_with(take, databases[1], after, lambda done, total: progress(total + done, 2 * total))
    return compared(take.name, first, second)


def compared(take: str, before: SolvedTake, after: SolvedTake) -> Comparison:
    """Two solutions of one take. Raises SettingError where their joints differ."""
    was, now = before.motion, resampled(after.motion, before.motion.fps)
    require_same_joints(was.skeleton, now.skeleton, f"the changed {take}")
    length = min(len(was), len(now))
    chosen = counted_joints(was.skeleton)
    names = tuple(was.skeleton.names[joint] for joint in chosen)
    there = _places_and_turns(was, names, length)
    here = _places_and_turns(now, names, length)
    tracked = {was.skeleton.role_joint(role) for role in ROLES}
    apart = logarithm(multiply(inverse(there[1].reshape(-1, 4)), here[1].reshape(-1, 4)))
    return Comparison(
        take,
        before,
        after,
        was.fps,
        names,
        tuple(number for number, joint in enumerate(chosen) if joint in tracked),
        np.degrees(np.linalg.norm(apart, axis=-1)).reshape(length, len(names)),
        100 * np.linalg.norm(there[0] - here[0], axis=-1),
    )


def _places_and_turns(
    motion: Motion, names: Sequence[str], length: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World places (T, J, 3) and local rotations (T, J, 4) of the named joints in the first frames."""
    order = [motion.skeleton.names.index(name) for name in names]
    places, _ = world_joints(motion.skeleton, motion.root_positions[:length], motion.rotations[:length])
    return places[:, order], motion.rotations[:length, order]


def solution_figures(solved: SolvedTake) -> dict:
    """`SolvedTake.figures`, and the jitter in m/s^3."""
    return solved.figures() | {"jitter_m_s3": _rounded(jitter_m_s3(solved.motion))}


def jitter_m_s3(motion: Motion) -> float:
    """Mean jerk of the counted joints in the world; 0 for fewer than four frames."""
    places, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    if len(places) < 4:
        return 0.0
    jerk = np.diff(places[:, counted_joints(motion.skeleton)], 3, axis=0) * motion.fps**3
    return float(np.linalg.norm(jerk, axis=-1).mean())


def pooled(comparisons: Sequence[Comparison]) -> Mapping[str, tuple[float, float]]:
    """Mean degrees and centimetres of each joint over all frames of all takes."""
    degrees, centimetres = (
        np.concatenate([getattr(c, name) for c in comparisons]).mean(axis=0) for name in ("degrees", "centimetres")
    )
    return {name: (float(d), float(c)) for name, d, c in zip(comparisons[0].joints, degrees, centimetres, strict=True)}


def _rounded(value: float | np.floating) -> float:
    return round(float(value), 4)


def _plain(values: NDArray[np.float64]) -> list[float]:
    return [round(float(value), 4) for value in values]
