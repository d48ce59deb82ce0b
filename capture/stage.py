"""What stands on the stage at one moment: skin, skeleton, trackers and lattice as the layers ask, as a `Scene`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.characters import Cast
from capture.curve_marks import curve_strokes
from capture.scene import (
    LATTICE,
    Camera,
    Lines,
    Scene,
    Spheres,
    Surface,
    ghost_marks,
    skeleton_marks,
    tracker_spheres,
)
from capture.skin_colours import SkinColours
from capture.standings import Standings
from capture.viewing import Layers
from deformation.character import Character
from deformation.deformer import DeformedMesh
from devices.frame import TrackerFrame, frozen
from devices.sample import ROLES
from reconstruction.skeleton import Skeleton

DOUBTFUL = np.array([0.90, 0.22, 0.16])
"""The colour of skin over a joint that is known to no better than `DOUBT_RAD`."""
DOUBT_RAD = 0.35
_FOLLOW_HEIGHT = 0.52
"""Where the camera looks, as a share of the performer's height."""
_CELL_EDGES = np.array([(a, b) for a in range(8) for b in range(8) if a < b and (a ^ b) in (1, 2, 4)])

_FROM_THE_SIDE = 0.5
"""Radians to the performer's left at which the camera stands."""
_NEARER_S, _ROUND_S = 0.15, 1.6
"""Seconds in which the camera makes up most of a distance, and of a turn."""


@dataclass(frozen=True)
class _View:
    """Where the camera looks, and which way it takes the performer to face, at a moment."""

    time_s: float
    target: NDArray[np.float64]
    facing: float

    def towards(self, goal: "_View") -> "_View":
        """This view, gone some way to where it should be."""
        elapsed = max(goal.time_s - self.time_s, 0.0)
        near, turned = 1 - math.exp(-elapsed / _NEARER_S), 1 - math.exp(-elapsed / _ROUND_S)
        left_to_turn = math.remainder(goal.facing - self.facing, math.tau)
        return _View(goal.time_s, self.target + near * (goal.target - self.target), self.facing + turned * left_to_turn)


class Stage:
    """Builds the scenes of one performer. The camera stays with them and comes round to their front, calmly."""

    def __init__(self, skeleton: Skeleton, cast: Cast | None) -> None:
        self.skeleton, self.cast = skeleton, cast
        character = self.character = cast.character if cast else None
        self._colours = SkinColours(character, cast.colours) if cast and character else None
        self._triangles = character.mesh.triangulated if character else np.empty((0, 3), np.int32)
        self._edges: NDArray[np.int32] | None = None
        self._view: _View | None = None

    def scene(
        self,
        time_s: float,
        frame: TrackerFrame | None,
        joints: NDArray[np.float64],
        skin: DeformedMesh | None,
        layers: Layers,
        sigma: NDArray[np.float64] | None = None,
        status: Sequence[str] = (),
        title: str = "",
        standings: Standings | None = None,
        ghosts: NDArray[np.float64] | None = None,
    ) -> Scene:
        """One moment, `time_s` seconds into whatever is shown.

        joints: (J, 4, 4) `T_world_joint`; sigma: (J,) radians, for the uncertainty tint; standings: of the trackers;
        ghosts: (K, J, 3) metres, other poses of the performer.
        """
        surfaces, lines, spheres = [], [], []
        if skin is not None:
            self._follow(skin.character)
        if skin is not None and layers.skin:
            surfaces.append(self._skin(skin, layers, sigma if layers.uncertainty else None))
        if layers.skeleton or not surfaces:
            bones, balls = skeleton_marks(self.skeleton, joints[:, :3, 3])
            lines.append(bones)
            spheres.append(balls)
        if layers.trackers and frame is not None:
            spheres.append(self._trackers(frame, standings, joints))
        if layers.ghosts and ghosts is not None:
            lines.append(ghost_marks(self.skeleton, ghosts))
        if layers.lattice and skin is not None:
            lines.append(Lines(frozen(skin.particles.copy()), self._lattice(), LATTICE, width=1.0, opacity=0.55))
        if layers.curves and skin is not None and self.character is not None:
            curves = curve_strokes(self.character.mesh)
            lifted = curves.lifted(skin.vertices, skin.normals)
            lines.append(Lines(lifted, curves.segments, curves.colours, width=0.8, opacity=0.7))
        camera = self._camera(time_s, joints[:, :3, 3])
        legend = self._colours.legend(layers.paint, layers.bone) if self._colours and surfaces else ""
        words = (*(status if layers.statistics else ()), *([legend] if legend else ()))
        return Scene(tuple(surfaces), tuple(lines), _only(spheres), camera, title=title, status=words)

    def cut(self) -> None:
        """The next scene is not the one after: the camera jumps to it."""
        self._view = None

    def _trackers(self, frame: TrackerFrame, standings: Standings | None, joints: NDArray[np.float64]) -> Spheres:
        if standings is None:
            return tracker_spheres(frame)
        places = joints[[self.skeleton.role_joint(role) for role in ROLES], :3, 3]
        return tracker_spheres(frame, now=standings.now, places=places)

    def _follow(self, character: Character) -> None:
        """The character may have been bound anew, to a finer lattice say, since the last scene."""
        if character is self.character or self.cast is None:
            return
        self.character, self._edges = character, None
        self._colours = SkinColours(character, self.cast.colours)

    def _lattice(self) -> NDArray[np.int32]:
        assert self.character is not None
        if self._edges is None:
            self._edges = _lattice_edges(self.character.lattice.cells)
        return self._edges

    def _skin(self, skin: DeformedMesh, layers: Layers, sigma: NDArray[np.float64] | None) -> Surface:
        assert self._colours is not None
        colours = self._colours.painted(layers.paint, layers.bone)
        if sigma is not None and self.cast is not None and self.cast.retargeter is None:
            colours = self._doubt(colours, sigma)
        return Surface(skin.vertices, self._triangles, skin.normals, colours)

    def _doubt(self, colours: ArrayLike, sigma: NDArray[np.float64]) -> NDArray[np.float64]:
        """(V, 3) the skin's colours, redder the less its joints are known."""
        assert self.character is not None
        on_vertices = (sigma[self.character.vertex_joints] * self.character.vertex_weights).sum(axis=1)
        share = np.clip(on_vertices / DOUBT_RAD, 0, 1)[:, None]
        return (1 - share) * np.asarray(colours) + share * DOUBTFUL

    def _camera(self, time_s: float, joints: NDArray[np.float64]) -> Camera:
        height = float(self._standing_height())
        hips = joints[0]
        goal = _View(time_s, np.array([hips[0], _FOLLOW_HEIGHT * height, hips[2]]), self._facing(joints))
        self._view = goal if self._view is None else self._view.towards(goal)
        x, y, z = self._view.target.tolist()
        return Camera(target=(x, y, z), distance=2.45 * height, yaw=self._view.facing + _FROM_THE_SIDE)

    def _facing(self, joints: NDArray[np.float64]) -> float:
        """Radians about the vertical: where the hips face, 0 along +Z."""
        bones = self.skeleton.humanoid
        left = joints[bones["left_upper_leg"]] - joints[bones["right_upper_leg"]]
        return math.atan2(-left[2], left[0])

    def _standing_height(self) -> float:
        if self.character is not None:
            return float(np.ptp(self.character.mesh.vertices[:, 1]))
        return 1.75


def _only(spheres: list[Spheres]) -> tuple[Spheres, ...]:
    return tuple(s for s in spheres if len(s.centres))


def _lattice_edges(cells: NDArray[np.int32]) -> NDArray[np.int32]:
    """(E, 2) each edge of the cells (C, 8) once."""
    pairs = np.sort(cells[:, _CELL_EDGES].reshape(-1, 2), axis=1)
    return np.unique(pairs, axis=0).astype(np.int32)
