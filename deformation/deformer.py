"""One frame of a character: joints in, particles, vertices and normals out."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deformation.character import Character
from deformation.materials import MATERIAL_REGIONS, SOFTEST, joint_factors, scaled_softness
from deformation.pose_shapes import PoseDrivenShapes
from deformation.secondary_motion import SecondaryMotion, SecondarySettings
from deformation.skinning import blend, joint_motion
from deformation.surface import Surface
from deformation.volume import preserve
from devices.errors import SettingError, choice_error

_POKE_SHARE = 0.25
"""How far a poke reaches, as a share of the skeleton's height."""

_REACH_CELLS = 1.0
"""The farthest that the volume's keeping moves a particle in one sweep, in cells."""


@dataclass(frozen=True)
class DeformSettings:
    """What is done to the particles after skinning; may be changed between frames.

    volume: keep the volume of each part. secondary: how the flesh swings, None for not at all.
    softness: factors, 0 to 3, on the softness of material regions by name (`materials.MATERIAL_REGIONS`): delta by
        region. Raises SettingError for an unknown region and a factor out of range.
    """

    volume: bool = True
    secondary: SecondarySettings | None = field(default_factory=SecondarySettings)
    softness: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for region, factor in self.softness.items():
            if region not in MATERIAL_REGIONS:
                raise choice_error("material region", region, MATERIAL_REGIONS)
            if not 0 <= factor <= SOFTEST:
                raise SettingError(f"softness of {region} = {factor}: use 0 to {SOFTEST:g}")


@dataclass(frozen=True, eq=False)
class DeformedMesh:
    """A character at one moment. The arrays are the deformer's own and hold until its next frame: copy what is kept.

    vertices: (V, 3) metres, world; normals: (V, 3) unit; particles: (P, 3) metres, world.
    character: whose mesh and lattice these are.
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    particles: NDArray[np.float64]
    character: Character


@dataclass(frozen=True, eq=False)
class _Push:
    """A hit that waits for the next frame."""

    velocity_m_s: NDArray[np.float64]
    centre: NDArray[np.float64]
    radius_m: float


class Deformer:
    """Deforms one character frame by frame."""

    def __init__(self, character: Character, settings: DeformSettings | None = None) -> None:
        self.character = character
        self._settings = settings or DeformSettings()
        lattice, vertices = character.lattice, character.mesh.vertices
        self._surface = Surface(character.mesh, lattice)
        self._flesh = SecondaryMotion(character.regions, self._softness(), lattice.cell_size)
        self._pushes: deque[_Push] = deque()
        self._particles, self._shown = np.empty_like(lattice.particles), np.empty_like(lattice.particles)
        self._rotations = np.empty((len(lattice.particles), 3, 3))
        self._vertices, self._normals = np.empty_like(vertices), np.empty_like(vertices)
        self._motion = joint_motion(character.bind, character.bind_inverse)
        self._shapes = _shapes(character)
        self._warm_up()

    @property
    def settings(self) -> DeformSettings:
        """What is done to the particles; set between two frames. Flesh that is switched on starts at rest."""
        return self._settings

    @settings.setter
    def settings(self, settings: DeformSettings) -> None:
        before, self._settings = self._settings, settings
        if settings.softness != before.softness:
            self._flesh.softness[:] = self._softness()
        if settings.secondary is None:
            self._flesh.reset()

    def _softness(self) -> NDArray[np.float64]:
        """(P,) the character's, by what the settings say of its regions."""
        factors = joint_factors(self.character.skeleton, self._settings.softness)
        return scaled_softness(self.character.softness, self.character.binding, factors)

    def _warm_up(self) -> None:
        """Has every kernel compiled, or fetched from its cache, before the first frame."""
        for _ in range(2):
            self.deform(self.character.bind, 1 / 30)
        preserve(self._particles * 0.99, self._rotations, self.character.parts, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forgets all motion: the next frame starts at rest on its pose."""
        self._flesh.reset()
        if self._shapes is not None:
            self._shapes.reset()

    def push(self, velocity_m_s: NDArray[np.float64], centre: NDArray[np.float64], radius_m: float) -> None:
        """Hits the flesh with the next frame: velocity (3,) metres a second at a point (3,) metres, fading out over a
        radius. May be called from any thread."""
        self._pushes.append(_Push(np.array(velocity_m_s), np.array(centre), radius_m))

    def poke(self, speed_m_s: float = 2.0) -> None:
        """Hits the softest of the flesh from below with the next frame, to see it swing. From any thread."""
        soft = self.character.softness
        most = soft >= 0.7 * soft.max()
        middle = self._particles[most].mean(axis=0)
        self.push(np.array([0.0, speed_m_s, 0.0]), middle, _POKE_SHARE * float(np.ptp(self.character.bind[:, 1, 3])))

    def _apply_pushes(self) -> None:
        while self._pushes:
            push = self._pushes.popleft()
            distance = np.linalg.norm(self._particles - push.centre, axis=1)
            self._flesh.push(np.clip(1 - distance / push.radius_m, 0, 1)[:, None] * push.velocity_m_s)

    def deform(self, T_world_joint: NDArray[np.float64], dt_s: float = 1 / 60) -> DeformedMesh:
        """The character at joints (J, 4, 4), world, dt_s seconds after the frame before."""
        self.skin(T_world_joint)
        particles = self._particles
        if self.settings.secondary is not None:
            self._apply_pushes()
            self._flesh.follow(particles, dt_s, self.settings.secondary, self._shown)
            particles = self._shown
        self._surface.vertices(particles, self._vertices)
        if self._shapes is not None:
            self._shapes.add(self._vertices, self._motion, dt_s)
        self._surface.normals(self._vertices, self._normals)
        return DeformedMesh(self._vertices, self._normals, particles, self.character)

    def mixed(self, vertices: NDArray[np.float64], share: float) -> DeformedMesh:
        """The last frame's mesh with `share` of its own vertices and the rest of these (V, 3) metres."""
        self._vertices *= share
        self._vertices += (1 - share) * vertices
        self._surface.normals(self._vertices, self._normals)
        particles = self._particles if self.settings.secondary is None else self._shown
        return DeformedMesh(self._vertices, self._normals, particles, self.character)

    def skin(self, T_world_joint: NDArray[np.float64]) -> NDArray[np.float64]:
        """The primary deformation alone (section III): particles (P, 3) metres, valid until the next frame."""
        character = self.character
        self._motion = joint_motion(T_world_joint, character.bind_inverse)
        blend(self._motion, character.binding, character.lattice.particles, self._particles, self._rotations)
        if self.settings.volume:
            preserve(self._particles, self._rotations, character.parts, _REACH_CELLS * character.lattice.cell_size)
        return self._particles


def _shapes(character: Character) -> PoseDrivenShapes | None:
    if not character.examples:
        return None
    parents, joints, weights = character.skeleton.parents, character.vertex_joints, character.vertex_weights
    return PoseDrivenShapes(character.mesh, parents, joints, weights, character.examples)
