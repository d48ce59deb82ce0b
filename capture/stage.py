"""What stands on the stage at one moment: skin, skeleton, trackers and lattice as the layers ask, as a `Scene`."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.scene import CLAY, LATTICE, Camera, Lines, Scene, Spheres, Surface, skeleton_marks, tracker_spheres
from capture.viewing import Layers
from deformation.character import Character
from deformation.deformer import DeformedMesh
from devices.frame import TrackerFrame, frozen
from reconstruction.skeleton import Skeleton

DOUBTFUL = np.array([0.90, 0.22, 0.16])
"""The colour of skin over a joint that is known to no better than `DOUBT_RAD`."""
DOUBT_RAD = 0.35
_FOLLOW_HEIGHT = 0.52
"""Where the camera looks, as a share of the performer's height."""
_CELL_EDGES = np.array([(a, b) for a in range(8) for b in range(8) if a < b and (a ^ b) in (1, 2, 4)])


class Stage:
    """Builds the scenes of one performer. The camera follows the hips, smoothly."""

    def __init__(self, skeleton: Skeleton, character: Character | None, colours: ArrayLike = CLAY) -> None:
        self.skeleton, self.character = skeleton, character
        self._colours = colours
        self._triangles = character.mesh.triangulated if character else np.empty((0, 3), np.int32)
        self._edges = _lattice_edges(character.lattice.cells) if character else np.empty((0, 2), np.int32)
        self._target: NDArray[np.float64] | None = None

    def scene(
        self,
        frame: TrackerFrame | None,
        joints: NDArray[np.float64],
        skin: DeformedMesh | None,
        layers: Layers,
        sigma: NDArray[np.float64] | None = None,
        status: Sequence[str] = (),
        title: str = "",
    ) -> Scene:
        """One moment. joints: (J, 4, 4) `T_world_joint`; sigma: (J,) radians, for the uncertainty tint."""
        surfaces, lines, spheres = [], [], []
        if skin is not None and layers.skin:
            surfaces.append(self._skin(skin, sigma if layers.uncertainty else None))
        if layers.skeleton or not surfaces:
            bones, balls = skeleton_marks(self.skeleton, joints[:, :3, 3])
            lines.append(bones)
            spheres.append(balls)
        if layers.trackers and frame is not None:
            spheres.append(tracker_spheres(frame))
        if layers.lattice and skin is not None:
            lines.append(Lines(frozen(skin.particles.copy()), self._edges, LATTICE, width=1.0, opacity=0.55))
        camera = self._camera(joints[0, :3, 3])
        words = tuple(status) if layers.statistics else ()
        return Scene(tuple(surfaces), tuple(lines), _only(spheres), camera, title=title, status=words)

    def cut(self) -> None:
        """The next scene is not the one after: the camera jumps to it."""
        self._target = None

    def _skin(self, skin: DeformedMesh, sigma: NDArray[np.float64] | None) -> Surface:
        colours = self._colours if sigma is None else self._doubt(sigma)
        return Surface(skin.vertices, self._triangles, skin.normals, colours)

    def _doubt(self, sigma: NDArray[np.float64]) -> NDArray[np.float64]:
        """(V, 3) the skin's colours, redder the less its joints are known."""
        assert self.character is not None
        on_vertices = (sigma[self.character.vertex_joints] * self.character.vertex_weights).sum(axis=1)
        share = np.clip(on_vertices / DOUBT_RAD, 0, 1)[:, None]
        return (1 - share) * np.asarray(self._colours) + share * DOUBTFUL

    def _camera(self, hips: NDArray[np.float64]) -> Camera:
        height = float(self._standing_height())
        goal = np.array([hips[0], _FOLLOW_HEIGHT * height, hips[2]])
        self._target = goal if self._target is None else self._target + 0.12 * (goal - self._target)
        x, y, z = self._target.tolist()
        return Camera(target=(x, y, z), distance=2.45 * height)

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
