"""A painting laid over what is found: bones, weights, parts, softness and half-widths of a lattice's particles."""

import numpy as np
from numpy.typing import NDArray

from deformation.heat_weights import Bones, heat_weights, separate_branches, skeleton_bones, spread, vertex_carrier
from deformation.lattice import Lattice
from deformation.materials import joint_softness, particle_softness
from deformation.painting import Painting
from deformation.skinning import Binding
from deformation.volume import without_small_parts
from reconstruction.skeleton import Skeleton


def painted_bones(
    skeleton: Skeleton,
    positions: NDArray[np.float64],
    width: float,
    strength: float,
    painting: Painting,
) -> Bones:
    """The bones that hold heat; width, strength: what the painting's factors multiply."""
    ones = np.ones(len(skeleton))
    widths = ones if painting.bone_widths is None else painting.bone_widths
    strengths = ones if painting.bone_strengths is None else painting.bone_strengths
    return skeleton_bones(skeleton, positions, width * widths, strength * strengths)


def painted_weights(
    fine: Lattice, bones: Bones, skeleton: Skeleton, positions: NDArray[np.float64], painting: Painting
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights of the fine lattice's particles (P, J) and of the vertices (V, J): painted, or else by heat."""
    painted = painting.weights
    if painted is not None and (painted.sum(axis=1) > 0).all():
        return spread(fine, painted), painted
    heat = separate_branches(heat_weights(fine, bones, skeleton), skeleton, positions)
    on_vertices = np.asarray(vertex_carrier(fine) @ heat)
    if painted is None:
        return heat, on_vertices
    on_vertices = np.where(painted.sum(axis=1, keepdims=True) > 0, painted, on_vertices)
    return spread(fine, on_vertices), on_vertices


def painted_bone_parts(lattice: Lattice, binding: Binding, painting: Painting) -> NDArray[np.int32]:
    """(P,) the bone-dependent part (fig. 5a) of each particle: its strongest bone, or as painted."""
    return _relabelled(lattice, binding.joints[:, 0], painting.bone_parts)


def painted_joint_parts(
    part_of: NDArray[np.int32], lattice: Lattice, skeleton: Skeleton, painting: Painting
) -> NDArray[np.int32]:
    """(P,) the joint-dependent part (fig. 5b) of each particle, after what the user says of it."""
    if painting.counted_to is not None:
        part_of = painting.counted_to[part_of]
    return without_small_parts(_relabelled(lattice, part_of, painting.joint_parts), skeleton)


def painted_softness(
    lattice: Lattice, binding: Binding, skeleton: Skeleton, bones: Bones, painting: Painting
) -> NDArray[np.float64]:
    """(P,) softness of each particle."""
    of_joint = overlaid(joint_softness(skeleton), painting.bone_softness)
    return laid_over(lattice, particle_softness(lattice, binding, bones, of_joint), painting.softness)


def painted_half_widths(
    lattice: Lattice, binding: Binding, half_width: int, painting: Painting
) -> NDArray[np.int32] | int:
    """(P,) or one number: half_width cells where nothing is painted."""
    if painting.bone_half_widths is None and painting.half_widths is None:
        return half_width
    of_joint = overlaid(np.full(binding.axes.shape[0], half_width), painting.bone_half_widths)
    widths = (of_joint[binding.joints] * binding.weights).sum(axis=1)
    painted = None
    if painting.half_widths is not None:
        painted = np.where(painting.half_widths > 0, painting.half_widths, np.nan)
    return np.rint(laid_over(lattice, widths, painted)).astype(np.int32)


def overlaid(values: NDArray, painted: NDArray | None) -> NDArray[np.float64]:
    """(J,) values, and painted ones where they are: neither NaN nor, where whole numbers, 0."""
    if painted is None:
        return values.astype(np.float64)
    there = np.isfinite(painted) if painted.dtype.kind == "f" else painted > 0
    return np.where(there, painted, values).astype(np.float64)


def laid_over(
    lattice: Lattice, values: NDArray[np.float64], painted: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """(P,) values of particles, drawn to those painted on vertices (V,) where these are not NaN."""
    if painted is None:
        return values
    there = np.isfinite(painted)
    carried = spread(lattice, np.stack([np.where(there, painted, 0.0), there], axis=1))
    return values * (1 - carried[:, 1]) + carried[:, 0]


def _relabelled(lattice: Lattice, labels: NDArray[np.int32], painted: NDArray[np.int32] | None) -> NDArray[np.int32]:
    """(P,) labels, and where vertices (V,) are painted with others (-1: none) the one that most of them have."""
    if painted is None:
        return labels
    kinds, index = np.unique(painted, return_inverse=True)
    share = spread(lattice, np.eye(len(kinds))[index.reshape(-1)])
    most = kinds[share.argmax(axis=1)]
    return np.where(most >= 0, most, labels).astype(np.int32)
