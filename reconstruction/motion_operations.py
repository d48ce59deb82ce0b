"""Operations on whole motions: another frame rate, the mirror image, parts, sequences, other proportions."""

import numpy as np
from numpy.typing import NDArray


def continuous_hemispheres(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same rotations (T, ..., 4) with each quaternion's sign such that it is nearest to the frame before."""
    same_side = np.einsum("t...k,t...k->t...", rotations[1:], rotations[:-1]) >= 0
    signs = np.cumprod(np.where(same_side, 1.0, -1.0), axis=0)
    return np.concatenate([rotations[:1], rotations[1:] * signs[..., None]])
