"""Roughly placed joints, drawn to the middle of the body around them (paper III-B)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from deformation.voxels import Voxels
from reconstruction.skeleton import Skeleton

_HALF_SLICE = 1.5
"""Half the thickness of a slice through a limb, in voxels."""

_REACH = 0.5
"""How far around a joint its slice goes, in lengths of its shorter bone: a shoulder's ends before the chest."""


def centred_joints(
    skeleton: Skeleton, positions: NDArray[np.float64], voxels: Voxels
) -> tuple[Skeleton, NDArray[np.float64]]:
    """The skeleton with its joints in the local middles of the body, and their positions (J, 3) metres.

    positions: (J, 3) metres, roughly placed, no joint turned. A joint moves to the centre of the slice through the body
    there, at right angles to its bones. The root, branching joints and ends of bones have no one direction, and stay.
    """
    moved = positions.copy()
    for joint, children in enumerate(skeleton.children):
        parent = skeleton.parents[joint]
        if parent < 0 or len(children) != 1:
            continue
        bones = positions[joint] - positions[parent], positions[children[0]] - positions[joint]
        reach = _REACH * min(float(np.linalg.norm(bone)) for bone in bones)
        along = bones[0] + bones[1]
        length = float(np.linalg.norm(along))
        if reach > voxels.size and length > voxels.size:
            moved[joint] = _middle_of_slice(voxels, positions[joint], along / length, reach)
    offsets = moved - np.where(skeleton.parents[:, None] >= 0, moved[skeleton.parents], 0)
    return replace(skeleton, offsets=offsets), moved


def _middle_of_slice(
    voxels: Voxels, place: NDArray[np.float64], along: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """The centre of the piece of body nearest to a place (3,) metres, in the slice through it; the place if none is."""
    away = voxels.origin + (voxels.solid + 0.5) * voxels.size - place
    near = (away**2).sum(axis=1) <= reach**2
    within = np.flatnonzero(near & (np.abs(away @ along) <= _HALF_SLICE * voxels.size))
    if not len(within):
        return place
    row = np.full(len(voxels.solid), -1)
    row[within] = np.arange(len(within))
    links = row[voxels.links]
    links = links[(links >= 0).all(axis=1)]
    graph = coo_matrix((np.ones(len(links), np.int8), tuple(links.T)), shape=(len(within), len(within)))
    piece = connected_components(graph, directed=False)[1]
    nearest = np.linalg.norm(away[within], axis=1).argmin()
    step = away[within[piece == piece[nearest]]].mean(axis=0)
    return place + step - (step @ along) * along
