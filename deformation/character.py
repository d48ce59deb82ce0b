"""A character: a mesh, a skeleton, and how the one hangs on the other."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deformation.heat_weights import blur, separate_branches, strongest
from deformation.lattice import CORNERS, Lattice, build_lattices, cell_size_for, expected_cell_size, trilinear
from deformation.materials import joint_softness
from deformation.mesh import Mesh
from deformation.painted import (
    laid_over,
    overlaid,
    painted_bone_parts,
    painted_bones,
    painted_half_widths,
    painted_joint_parts,
    painted_softness,
    painted_weights,
)
from deformation.painting import UNPAINTED, Painting
from deformation.pose_shapes import ExampleShape
from deformation.shape_matching import Regions, make_regions
from deformation.skinning import Binding, bind_points
from deformation.volume import VolumeParts, joint_parts, volume_parts
from devices.errors import SettingError
from devices.frame import frozen
from reconstruction.motion import Pose
from reconstruction.skeleton import Skeleton

DEFAULT_PARTICLES = 1900
"""About what the paper settles on (section V)."""

_MOST_WEIGHED = 30_000
"""Above so many particles the weights are worked out on the lattice itself, no longer on one of half its cells."""


@dataclass(frozen=True)
class LatticeSettings:
    """How finely a character is cut into cells, and how its bones claim them.

    cell_size_m: edge of a cell; particles: about how many, instead of the cell size. With neither, about 1,900.
    bone_width: radius of a bone in half cells; bone_strength: its heat e_j.
    region_half_width: cells, 1 to 5, of the shape matching regions; in wider ones the flesh moves more as one.
    """

    cell_size_m: float | None = None
    particles: int | None = None
    bone_width: float = 1.0
    bone_strength: float = 1.0
    region_half_width: int = 2


@dataclass(frozen=True, eq=False)
class Character:
    """A mesh bound to a skeleton by a lattice.

    bind: (J, 4, 4) `T_world_joint` at which the mesh stands as it is.
    vertex_joints: (V, 4) int32, vertex_weights: (V, 4), rows sum to 1, strongest first: for exchange formats and plain
        linear blending. binding: the same of the lattice's particles, which drive the mesh here.
    parts: the lattice by joints, for the volume. softness: (P,) 0 to 1, share of the secondary motion taken.
    regions: what moves together in shape matching, with a half-width for each particle.
    examples: shapes that come in as joints turn, over all else (`pose_shapes`).
    settings, painting: what it was bound with, for binding it anew.
    """

    name: str
    mesh: Mesh
    skeleton: Skeleton
    bind: NDArray[np.float64]
    vertex_joints: NDArray[np.int32]
    vertex_weights: NDArray[np.float64]
    lattice: Lattice
    binding: Binding
    parts: VolumeParts
    softness: NDArray[np.float64]
    regions: Regions
    examples: tuple[ExampleShape, ...] = ()
    settings: LatticeSettings = LatticeSettings()
    painting: Painting = UNPAINTED

    @cached_property
    def bind_inverse(self) -> NDArray[np.float64]:
        """(J, 4, 4) `T_joint_world` of the bind pose."""
        return np.linalg.inv(self.bind).astype(np.float64)


def make_character(
    mesh: Mesh,
    skeleton: Skeleton,
    bind: NDArray[np.float64],
    name: str = "character",
    settings: LatticeSettings | None = None,
    painting: Painting = UNPAINTED,
) -> Character:
    """Binds a mesh (metres) to a skeleton that stands in it at bind (J, 4, 4), by heat in a lattice.

    The heat is worked out on a lattice of half the cell size, and carried from there to vertices and particles.
    painting: what is not to be found but as painted, weights say.
    Raises SettingError where the settings or the mesh give no lattice.
    """
    settings = settings or LatticeSettings()
    lattice, fine, parents = build_lattices(mesh, _cell_size(mesh, settings))
    if len(fine.particles) > _MOST_WEIGHED:
        fine, parents = lattice, np.arange(len(lattice.cells), dtype=np.int32)
    positions = np.ascontiguousarray(bind[:, :3, 3])
    bones = painted_bones(
        skeleton,
        positions,
        settings.bone_width * lattice.cell_size / 2,
        settings.bone_strength,
        painting,
    )
    fine_weights, on_vertices = painted_weights(fine, bones, skeleton, positions, painting)
    vertex_joints, vertex_weights = (frozen(a) for a in strongest(on_vertices))
    on_particles = separate_branches(blur(lattice) @ coarser(fine_weights, fine, lattice, parents), skeleton, positions)
    joints, weights = (frozen(a) for a in strongest(on_particles))
    binding = bind_points(skeleton, positions, joints, weights, lattice.particles)
    part_of = joint_parts(lattice, painted_bone_parts(lattice, binding, painting), skeleton, positions)
    return Character(
        name,
        mesh,
        skeleton,
        frozen(np.array(bind)),
        vertex_joints,
        vertex_weights,
        lattice,
        binding,
        volume_parts(lattice, painted_joint_parts(part_of, lattice, skeleton, painting)),
        frozen(painted_softness(lattice, binding, skeleton, bones, painting)),
        make_regions(lattice, painted_half_widths(lattice, binding, settings.region_half_width, painting)),
        settings=settings,
        painting=painting,
    )


def rebound(character: Character, settings: LatticeSettings) -> Character:
    """The same character on another lattice, with all that is painted on it. Raises SettingError as above."""
    new = make_character(
        character.mesh, character.skeleton, character.bind, character.name, settings, character.painting
    )
    return replace(new, examples=character.examples)


def repainted(character: Character, painting: Painting) -> Character:
    """The character with more painted over what already is."""
    return rebound(replace(character, painting=painting.over(character.painting)), character.settings)


def painting_of(character: Character) -> Painting:
    """All that a painting can say of a character, as it stands: something to start painting from."""
    lattice, names = character.lattice, len(character.skeleton)
    corners, share = lattice.cells[lattice.vertex_cells], lattice.vertex_weights
    nearest = corners[np.arange(len(corners)), share.argmax(axis=1)]
    weights = np.zeros((len(character.mesh.vertices), names))
    for place in range(character.vertex_joints.shape[1]):
        weights[np.arange(len(weights)), character.vertex_joints[:, place]] += character.vertex_weights[:, place]
    parts, given = character.parts, character.painting
    ones = np.ones(names)
    return Painting(
        weights,
        (character.softness[corners] * share).sum(axis=1),
        character.regions.half_widths[nearest],
        character.binding.joints[nearest, 0],
        parts.joints[parts.part_of[nearest]],
        overlaid(joint_softness(character.skeleton), given.bone_softness),
        overlaid(np.full(names, character.settings.region_half_width), given.bone_half_widths).astype(np.int32),
        ones if given.bone_widths is None else given.bone_widths,
        ones if given.bone_strengths is None else given.bone_strengths,
        np.arange(names, dtype=np.int32) if given.counted_to is None else given.counted_to,
    )


def mannequin_character(
    skeleton: Skeleton,
    resolution: str = "medium",
    reference: Pose | None = None,
    settings: LatticeSettings | None = None,
) -> Character:
    """The mannequin, fitted to a skeleton and bound to it: low, medium or high resolution."""
    from deformation.mannequin import mannequin

    mesh, bind = mannequin(skeleton, resolution, reference)
    return make_character(mesh, skeleton, bind, "mannequin", settings)


def with_softness(character: Character, vertex_softness: NDArray[np.float64]) -> Character:
    """The character with another softness, painted on its vertices: (V,) 0 to 1, else SettingError is raised."""
    painted = np.asarray(vertex_softness, np.float64).reshape(-1)
    if len(painted) != len(character.mesh.vertices) or not ((painted >= 0) & (painted <= 1)).all():
        raise SettingError(f"softness: give {len(character.mesh.vertices)} numbers from 0 to 1, one a vertex")
    painting = Painting(softness=frozen(painted.copy())).over(character.painting)
    soft = frozen(laid_over(character.lattice, character.softness, painted))
    return replace(character, softness=soft, painting=painting)


def coarser(
    weights: NDArray[np.float64], fine: Lattice, coarse: Lattice, parents: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Particle weights (P, J) of a coarse lattice: means of the fine ones (P_fine, J) by their share in its cells.

    parents: (C_fine,) the coarse cell that holds each fine cell.
    """
    low = coarse.particles[coarse.cells[:, 0]][parents]
    places = (fine.particles[fine.cells] - low[:, None, :]) / coarse.cell_size
    share = trilinear(places.reshape(-1, 3)).reshape(len(parents), 8, 8)
    total = np.zeros((len(coarse.particles), weights.shape[1] + 1))
    carried = np.concatenate([weights, np.ones((len(weights), 1))], axis=1)[fine.cells]
    for corner in range(len(CORNERS)):
        np.add.at(total, coarse.cells[parents, corner], np.einsum("ck,ckj->cj", share[:, :, corner], carried))
    return total[:, :-1] / total[:, -1:]


def _cell_size(mesh: Mesh, settings: LatticeSettings) -> float:
    if settings.cell_size_m is not None and settings.particles is not None:
        raise SettingError("cell size and particle count are both set: use one of them")
    if settings.particles is not None:
        return cell_size_for(mesh, settings.particles)
    if settings.cell_size_m is not None:
        return settings.cell_size_m
    return expected_cell_size(mesh, DEFAULT_PARTICLES)
