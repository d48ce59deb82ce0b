"""A character: a mesh, a skeleton, and how the one hangs on the other."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deformation.heat_weights import blur, heat_weights, separate_branches, skeleton_bones, spread, strongest
from deformation.lattice import CORNERS, Lattice, build_lattices, cell_size_for, expected_cell_size, trilinear
from deformation.materials import default_softness
from deformation.mesh import Mesh
from deformation.pose_shapes import ExampleShape
from deformation.shape_matching import Regions, make_regions
from deformation.skinning import Binding, bind_points
from deformation.volume import VolumeParts, volume_parts
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
    vertex_weights: NDArray[np.float64] | None = None,
) -> Character:
    """Binds a mesh (metres) to a skeleton that stands in it at bind (J, 4, 4), by heat in a lattice.

    The heat is worked out on a lattice of half the cell size, and carried from there to vertices and particles.
    vertex_weights: (V, J), rows sum to 1, to use painted weights instead of heat.
    Raises SettingError where the settings or the mesh give no lattice.
    """
    settings = settings or LatticeSettings()
    lattice, fine, parents = build_lattices(mesh, _cell_size(mesh, settings))
    if len(fine.particles) > _MOST_WEIGHED:
        fine, parents = lattice, np.arange(len(lattice.cells), dtype=np.int32)
    positions = np.ascontiguousarray(bind[:, :3, 3])
    bones = skeleton_bones(skeleton, positions, settings.bone_width * lattice.cell_size / 2, settings.bone_strength)
    if vertex_weights is not None:
        fine_weights, on_vertices = spread(fine, vertex_weights), vertex_weights
    else:
        fine_weights = separate_branches(heat_weights(fine, bones, skeleton), skeleton, positions)
        on_vertices = np.einsum("vk,vkj->vj", fine.vertex_weights, fine_weights[fine.cells[fine.vertex_cells]])
    vertex_joints, vertex_weights = (frozen(a) for a in strongest(on_vertices))
    on_particles = separate_branches(blur(lattice) @ coarser(fine_weights, fine, lattice, parents), skeleton, positions)
    joints, weights = (frozen(a) for a in strongest(on_particles))
    binding = bind_points(skeleton, positions, joints, weights)
    return Character(
        name,
        mesh,
        skeleton,
        frozen(np.array(bind)),
        vertex_joints,
        vertex_weights,
        lattice,
        binding,
        volume_parts(lattice, binding, skeleton, positions),
        frozen(default_softness(lattice, binding, skeleton, bones)),
        make_regions(lattice, settings.region_half_width),
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
    painted = np.asarray(vertex_softness, np.float64).reshape(-1, 1)
    if len(painted) != len(character.mesh.vertices) or not ((painted >= 0) & (painted <= 1)).all():
        raise SettingError(f"softness: give {len(character.mesh.vertices)} numbers from 0 to 1, one a vertex")
    return replace(character, softness=frozen(spread(character.lattice, painted)[:, 0]))


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
