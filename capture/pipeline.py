"""From the trackers of one moment to a picture's worth: solve the pose, stand the joints, deform the skin."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from capture.characters import Cast
from capture.director import Act, Director
from capture.standings import Standings, StandingsWatch
from deformation.deformer import DeformedMesh, DeformSettings
from deformation.live_deformer import LiveDeformer
from devices.frame import TrackerFrame, frozen
from devices.sample import ROLES
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Pose
from reconstruction.solution import Solution
from reconstruction.solver import Reconstructor

_WARM_UP_FRAMES = 4
BOW_S = 0.8
"""Seconds from the end of a session into idling."""


@dataclass(frozen=True, eq=False, slots=True)
class Shot:
    """All that is known of one moment.

    frame: the trackers; solution: the pose and how far it can be trusted.
    joints: (J, 4, 4) `T_world_joint` of the performer, as shown.
    skin: the deformed character, its own copy, or None where nothing is skinned.
    stages_ns: nanoseconds spent by stage. standings: how the trackers have been doing since the start.
    """

    frame: TrackerFrame
    solution: Solution
    joints: NDArray[np.float64]
    skin: DeformedMesh | None
    stages_ns: dict[str, int]
    standings: Standings


class Pipeline:
    """The stages in their order, one `step` a tracker frame."""

    def __init__(
        self,
        reconstructor: Reconstructor,
        cast: Cast | None = None,
        director: Director | None = None,
        settings: DeformSettings | None = None,
    ) -> None:
        self.reconstructor, self.cast, self.director = reconstructor, cast, director
        self.deformer = LiveDeformer(cast.character, settings) if cast else None
        self._watch = StandingsWatch()
        self._last_s: float | None = None

    def step(self, frame: TrackerFrame) -> Shot:
        """One moment, from trackers to vertices."""
        begin = time.perf_counter_ns()
        solution = self.reconstructor.solve(frame)
        solved = time.perf_counter_ns()
        pose = self.director.shown(solution.pose) if self.director else solution.pose
        joints = frozen(world_transforms(self.reconstructor.skeleton, pose.root_position, pose.rotations))
        stood = time.perf_counter_ns()
        skin = self._skinned(pose, joints, self._elapsed(frame.time_s))
        end = time.perf_counter_ns()
        stages = {"solve": solved - begin, "joints": stood - solved, "skin": end - stood, "whole frame": end - begin}
        return Shot(frame, solution, joints, skin, stages, self._watch.seen(frame, solution.states))

    def warm_up(self) -> None:
        """Runs some frames of the database through and forgets them: no kernel is loaded in the first real ones."""
        tracks = np.asarray(self.reconstructor.database.tracks[:_WARM_UP_FRAMES], np.float64)
        for number, positions in enumerate(tracks):
            self.step(TrackerFrame.from_positions(number / 60, dict(zip(ROLES, positions, strict=True))))
        self.reset()

    def bow_out(self, last: Shot, frame_s: float) -> Iterator[Shot]:
        """From the last shot into idling: the shots of `BOW_S` seconds, made at once. None without a director."""
        if self.director is None:
            return
        self.director.ask(Act.IDLE)
        for number in range(1, round(BOW_S / frame_s) + 1):
            time_s = last.frame.time_s + number * frame_s
            live = last.solution.pose
            pose = self.director.shown(Pose(time_s, live.root_position, live.rotations))
            joints = frozen(world_transforms(self.reconstructor.skeleton, pose.root_position, pose.rotations))
            skin = self._skinned(pose, joints, frame_s)
            yield replace(last, frame=replace(last.frame, time_s=time_s), joints=joints, skin=skin, stages_ns={})

    def reset(self) -> None:
        """Forgets what was before, as at the start of a take."""
        self.reconstructor.reset()
        if self.deformer:
            self.deformer.reset()
        if self.director:
            self.director.reset()
        self._watch = StandingsWatch()
        self._last_s = None

    def _skinned(self, pose: Pose, joints: NDArray[np.float64], elapsed_s: float) -> DeformedMesh | None:
        if self.cast is None or self.deformer is None:
            return None
        if self.cast.retargeter is not None:
            own = self.cast.pose(pose)
            joints = world_transforms(self.cast.character.skeleton, own.root_position, own.rotations)
        return _kept(self.deformer.deform(joints, elapsed_s))

    def _elapsed(self, time_s: float) -> float:
        """Seconds since the last frame, one sixtieth for the first."""
        elapsed = 1 / 60 if self._last_s is None else time_s - self._last_s
        self._last_s = time_s
        return max(elapsed, 0.0)


def _kept(skin: DeformedMesh) -> DeformedMesh:
    """A copy that stays when the deformer goes on: another thread may be drawing it."""
    return replace(
        skin,
        vertices=frozen(skin.vertices.copy()),
        normals=frozen(skin.normals.copy()),
        particles=frozen(skin.particles.copy()),
    )
