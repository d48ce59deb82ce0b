"""The centre of mass over the support, while both clips stand: the hips give way sideways, the legs follow."""

import numpy as np
from numpy.typing import NDArray

from reconstruction.transition.crossing import Crossing
from reconstruction.transition.footwork import Step

SUPPORT_RADIUS_M = 0.08
"""How far the centre of mass may be over the ground from the line between the middles of the feet that stand."""
_SMOOTH_S = 0.2


def support_excess(
    centre: NDArray[np.float64], feet: NDArray[np.float64], standing: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(N, 2) metres over the ground (x, z): the shortest way that brings the centre of mass back over the support.

    centre: (N, 3); feet: (N, F, 3) the middles of the feet; standing: (N, F). Zero where no foot stands.
    """
    ground, points = centre[:, [0, 2]], feet[:, :, [0, 2]]
    first = np.where(standing[:, :1], points[:, 0], points[:, -1])
    last = np.where(standing[:, -1:], points[:, -1], points[:, 0])
    along = last - first
    share = np.sum((ground - first) * along, axis=-1) / np.maximum(np.sum(along**2, axis=-1), 1e-12)
    way = first + np.clip(share, 0, 1)[:, None] * along - ground
    distance = np.linalg.norm(way, axis=-1, keepdims=True)
    inward = way * np.maximum(1 - SUPPORT_RADIUS_M / np.maximum(distance, 1e-9), 0)
    return np.where(standing.any(axis=1, keepdims=True), inward, 0.0)


def balancing_shift(
    crossing: Crossing,
    centre: NDArray[np.float64],
    feet: NDArray[np.float64],
    steps: list[Step],
    t: NDArray[np.float64],
    fade: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(N, 3) metres by which the root moves over the ground.

    centre: (N, 3) metres, the centre of mass as it would go; feet: (N, F, 3); fade: (N,) 0 at the seams, 1 between:
    what the clips themselves lean is left to them.
    """
    standing = np.stack([(t < step.lift_s) | (t > step.land_s) for step in steps], axis=1)
    held = crossing.gaps < 0.02
    standing |= held & crossing.stands_out & crossing.stands_in
    shift = np.zeros((len(t), 3))
    way = support_excess(centre, feet, standing) * fade[:, None]
    width = max(round(_SMOOTH_S * crossing.a.fps), 1)
    kernel = np.ones(width) / width
    for axis, k in ((0, 0), (2, 1)):
        smooth = np.convolve(np.pad(way[:, k], width), kernel, "same")
        shift[:, axis] = np.convolve(smooth, kernel, "same")[width:-width]
    return shift * fade[:, None]
