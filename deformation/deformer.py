"""One frame of a character: joints in, particles, vertices and normals out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deformation.character import Character
from deformation.skinning import blend, joint_motion
from deformation.surface import Surface


@dataclass(frozen=True)
class DeformSettings:
    """What is done to the particles after skinning."""


@dataclass(frozen=True, eq=False)
class DeformedMesh:
    """A character at one moment; the arrays are the deformer's own and hold until its next frame.

    vertices: (V, 3) metres, world; normals: (V, 3) unit; particles: (P, 3) metres, world.
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    particles: NDArray[np.float64]


class Deformer:
    """Deforms one character frame by frame."""

    def __init__(self, character: Character, settings: DeformSettings | None = None) -> None:
        self.character = character
        self.settings = settings or DeformSettings()
        self._surface = Surface(character.mesh, character.lattice)
        self._particles = np.empty_like(character.lattice.particles)
        self._rotations = np.empty((len(self._particles), 3, 3))
        self._vertices = np.empty_like(character.mesh.vertices)
        self._normals = np.empty_like(character.mesh.vertices)

    def reset(self) -> None:
        """Forgets all motion: the next frame starts at rest on its pose."""

    def deform(self, T_world_joint: NDArray[np.float64], dt_s: float = 1 / 60) -> DeformedMesh:
        """The character at joints (J, 4, 4), world, dt_s seconds after the frame before."""
        motion = joint_motion(T_world_joint, self.character.bind_inverse)
        blend(motion, self.character.binding, self.character.lattice.particles, self._particles, self._rotations)
        self._surface.vertices(self._particles, self._vertices)
        self._surface.normals(self._vertices, self._normals)
        return DeformedMesh(self._vertices, self._normals, self._particles)
