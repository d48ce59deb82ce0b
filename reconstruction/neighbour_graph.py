"""The paper's own accelerator: a neighbour graph that is walked from the last frame's neighbours.

After Chai and Hodgins, "Performance Animation from Low-Dimensional Control Signals", SIGGRAPH 2005. A motion goes on:
what is near a frame follows what was near the frame before, or is near to that. So each window keeps links to windows
near to it, and a search looks only at the windows that follow the last neighbours and, from near to nearer, at what
they are linked to. Windows a frame apart are near duplicates, so that links lead to other moments, and to the windows
just before and after.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from devices.progress import Progress, no_progress
from reconstruction.neighbours import NeighbourIndex

LINKS = 16
"""Windows that a window is linked to, besides those just before and after it."""
APART = 4
"""Windows that linked ones, and the window itself, are at least from each other."""
CANDIDATES = 128
"""Nearest windows that links are chosen from."""
LOOKED_AT = 50_000
"""Windows that are compared for a start."""
BREADTH = 2
"""The walk ends when the nearest so many times the count asked for have all been looked around."""


@dataclass(frozen=True, eq=False)
class NeighbourGraph:
    """Windows and their links.

    vectors: (W, F) float32, what windows are compared by, in the order of the database.
    links: (W, L + 2) int32, numbers of windows; the window before and the one after it first; -1 for none.
    """

    vectors: NDArray[np.float32]
    links: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.vectors)

    @classmethod
    def built(
        cls, vectors: NDArray[np.float32], rows: NDArray[np.int32], progress: Progress = no_progress
    ) -> "NeighbourGraph":
        """The graph of windows (W, F) that end at database rows (W,), rising."""
        apart = max(1, len(vectors) // NeighbourIndex.sample_size(len(vectors)))
        index = NeighbourIndex.trained(vectors[::apart], len(vectors))
        index.add(vectors)
        links = np.full((len(vectors), LINKS + 2), -1, np.int32)
        going_on = np.flatnonzero(np.diff(rows) == 1)
        links[going_on + 1, 0], links[going_on, 1] = going_on, going_on + 1
        for start in range(0, len(vectors), 8192):
            part = slice(start, start + 8192)
            near = index.near_to_all(vectors[part], min(CANDIDATES, len(vectors)))
            choose_links(near, start, APART, links[part, 2:])
            progress(min(part.stop, len(vectors)), len(vectors))
        return cls(vectors, links)

    def nearest(
        self, query: NDArray[np.float32], begin: NDArray[np.int64], count: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Numbers (k,) and distances (k,) of the nearest windows to one (F,) that a walk from the windows `begin` (b,)
        comes by, nearest first; k <= count."""
        numbers, squares = np.empty(BREADTH * count, np.int64), np.empty(BREADTH * count)
        found = walk(query, begin, self.vectors, self.links, numbers, squares)
        return numbers[: min(found, count)], np.sqrt(squares[: min(found, count)])

    def begun(self, query: NDArray[np.float32], count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The same where no walk has begun: from the nearest of about `LOOKED_AT` windows, evenly spread."""
        apart = max(1, len(self) // LOOKED_AT)
        difference = self.vectors[::apart] - query
        squares = np.einsum("wf,wf->w", difference, difference)
        best = np.argpartition(squares, min(count, len(squares)) - 1)[:count]
        return self.nearest(query, apart * best, count)


@njit(cache=True)
def choose_links(near, first, apart, links):
    """Fills links (n, L) of the windows from number `first` on: the first of their nearest (n, C), -1 for none, that
    are at least `apart` windows from themselves and from each other."""
    for i in range(len(near)):
        taken = 0
        for number in near[i]:
            free = number >= 0 and abs(number - (first + i)) >= apart
            for k in range(taken):
                free = free and abs(number - links[i, k]) >= apart
            if free:
                links[i, taken] = number
                taken += 1
                if taken == links.shape[1]:
                    break


@njit(cache=True)
def walk(query, begin, vectors, links, numbers, squares):
    """Best-first walk: keeps the nearest windows seen in `numbers` with squared distances, (B,) each, nearest first,
    and looks around the nearest that it has not looked around, until it has around all. Returns how many there are."""
    seen = set(begin[:0])
    looked_around = np.zeros(len(numbers), np.bool_)
    size, at = 0, 0
    for number in begin:
        if number not in seen:
            seen.add(number)
            size = keep(number, query, vectors, numbers, squares, looked_around, size)
    while at < size:
        if looked_around[at]:
            at += 1
            continue
        looked_around[at] = True
        for link in links[numbers[at]]:
            number = np.int64(link)
            if number >= 0 and number not in seen:
                seen.add(number)
                size = keep(number, query, vectors, numbers, squares, looked_around, size)
        at = 0
    return size


@njit(cache=True)
def keep(number, query, vectors, numbers, squares, looked_around, size):
    """Puts a window into its place among the nearest, where it is one of them; how many there are then."""
    limit = squares[size - 1] if size == len(numbers) else np.inf
    square = 0.0
    for f in range(len(query)):
        difference = vectors[number, f] - query[f]
        square += difference * difference
    if square >= limit:
        return size
    place = min(size, len(numbers) - 1)
    while place > 0 and squares[place - 1] > square:
        numbers[place], squares[place] = numbers[place - 1], squares[place - 1]
        looked_around[place] = looked_around[place - 1]
        place -= 1
    numbers[place], squares[place], looked_around[place] = number, square, False
    return min(size + 1, len(numbers))
