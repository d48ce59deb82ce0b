"""Leaving near duplicates out: frames beside each other in one clip say one thing twice."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


def thinned(rows: NDArray[np.int64], clips: NDArray[np.int64], apart: int, count: int) -> NDArray[np.int64]:
    """Places of at most `count` rows (n,), in order, none nearer than `apart` frames to a better one of its clip."""
    kept = np.empty(min(count, len(rows)), np.int64)
    return kept[: thinning_kernel(rows, clips, apart, kept)]


def thinned_reference(rows: NDArray[np.int64], clips: NDArray[np.int64], apart: int, count: int) -> list[int]:
    """The same, plainly."""
    kept: list[int] = []
    for number in range(len(rows)):
        near = [k for k in kept if clips[k] == clips[number] and abs(rows[k] - rows[number]) < apart]
        if not near and len(kept) < count:
            kept.append(number)
    return kept


@njit(cache=True)
def thinning_kernel(rows, clips, apart, kept):
    """Fills `kept` (count,) and returns how many there are."""
    found = 0
    for number in range(len(rows)):
        if found == len(kept):
            break
        alone = True
        for k in kept[:found]:
            if abs(rows[k] - rows[number]) < apart and clips[k] == clips[number]:
                alone = False
                break
        if alone:
            kept[found] = number
            found += 1
    return found
