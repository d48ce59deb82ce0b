"""Matching trackers alone against every pose of the database: the start from any pose, and the way back.

Where the trackers were over some moments is laid onto where the tracked joints of a clip were over the same moments.
Only the place on the floor and the facing are free, and the best of both has a closed form for any number of points
(a planar Procrustes fit): one pass over the database needs no index and serves any subset of trackers.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from reconstruction.database import MotionDatabase
from reconstruction.window_features import seen_from


@dataclass(frozen=True, eq=False)
class Sighting:
    """Tracker positions at some moments, as one match takes them.

    offsets: (L,) int64 frames from the moment that is asked about, negative for the past;
    points: (L, 6, 3) metres in the database's scale, NaN where missing.
    """

    offsets: NDArray[np.int64]
    points: NDArray[np.float64]

    @property
    def count(self) -> int:
        """How many positions there are."""
        return int(np.isfinite(self.points[..., 0]).sum())


@dataclass(frozen=True, eq=False)
class Matches:
    """Database rows by how well their clips fit.

    rows: (K,), best first; errors: (K,) metres, root mean square over all positions;
    heading: (3,) where the best row's heading frame must stand for its clip to lie on the trackers.
    """

    rows: NDArray[np.int64]
    errors: NDArray[np.float64]
    heading: NDArray[np.float64]


class TrackerMatcher:
    """Finds database rows by trackers alone."""

    LOOKED_AT = 20_000
    """Rows that a search of everything looks at first, evenly spread."""
    KEEP = 64
    """The best of them, around which it looks at all."""

    def __init__(self, database: MotionDatabase):
        self._tracks, self._headings = np.asarray(database.tracks), np.asarray(database.headings)
        self._first = database.firsts
        self._end = self._first + np.array([clip.frames for clip in database.clips])

    def __len__(self) -> int:
        return len(self._tracks)

    def squares(self, sighting: Sighting, rows: NDArray[np.int64], free: bool = True) -> NDArray[np.float64]:
        """Sums of squared distances (n,) for rows (n,); infinite where a moment lies outside the row's clip.

        free: whether place and facing are the best ones; else the sighting is taken as seen from the rows' own
        heading frames.
        """
        return self.fits(sighting, rows, free)[0]

    def fits(self, sighting: Sighting, rows: NDArray[np.int64], free: bool = True) -> NDArray[np.float64]:
        """(2, n): what `squares` gives, and which way, radians, each row's body faces as it lies on the sighting."""
        clip = np.searchsorted(self._first, rows, side="right") - 1
        out = np.empty((2, len(rows)))
        args = (self._tracks, self._headings, sighting.offsets, sighting.points)
        match_kernel(rows, self._first[clip], self._end[clip], *args, free, *out)
        return out

    def best(self, sighting: Sighting, rows: NDArray[np.int64], count: int) -> Matches:
        """The best `count` of rows (n,); fewer where fewer are possible."""
        squares = self.squares(sighting, rows)
        order = np.lexsort((rows, squares))[:count]
        order = order[np.isfinite(squares[order])]
        errors = np.sqrt(np.maximum(squares[order], 0) / max(sighting.count, 1))
        heading = self._heading(sighting, int(rows[order[0]])) if len(order) else np.zeros(3)
        return Matches(rows[order], errors, heading)

    def best_of_all(self, sighting: Sighting) -> Matches:
        """The best row of the whole database, or none: every so many-th row, then all rows around the best of them.

        A million rows take little longer than ten thousand.
        """
        stride = max(1, len(self) // self.LOOKED_AT)
        coarse = self.best(sighting, np.arange(0, len(self), stride), self.KEEP)
        return self.best(sighting, self.around(coarse.rows, stride // 2), 1)

    def best_by_facing(self, sighting: Sighting) -> list[Matches]:
        """The best row for each direction that the body may face, where there is one; best first.

        Every so many-th row is looked at, as first in `best_of_all`.
        """
        rows = np.arange(0, len(self), max(1, len(self) // self.LOOKED_AT))
        return [self.best(sighting, rows[[place]], 1) for place in best_by_direction(*self.fits(sighting, rows))]

    def around(self, rows: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
        """All rows that are at most `reach` from one of rows (n,)."""
        near = np.unique((rows[:, None] + np.arange(-reach, reach + 1)).ravel())
        return near[(near >= 0) & (near < len(self))]

    def error(self, sighting: Sighting, rows: NDArray[np.int64], heading: NDArray[np.float64]) -> float:
        """Metres: least root mean square distance of rows (n,) whose heading frames stand at `heading` (3,).

        NaN where no row has all the moments.
        """
        frames = np.tile(heading, (len(sighting.offsets), 1))
        seen = Sighting(sighting.offsets, seen_from(sighting.points, 0 * frames, frames))
        squares = self.squares(seen, rows, free=False)
        squares = squares[np.isfinite(squares)]
        return float(np.sqrt(squares.min() / max(sighting.count, 1))) if len(squares) else np.nan

    def _heading(self, sighting: Sighting, row: int) -> NDArray[np.float64]:
        """Where (3,) a row's heading frame must stand for its clip to lie best on a sighting."""
        model = self.trajectory(row, sighting.offsets)
        there = np.isfinite(sighting.points[..., 0])
        return planar_fit(model[there], sighting.points[there])

    def trajectory(self, row: int, offsets: NDArray[np.int64]) -> NDArray[np.float64]:
        """Tracked joints (L, 6, 3) metres around a row, seen from its heading frame."""
        out = np.empty((len(offsets), *self._tracks.shape[1:]))
        trajectory_kernel(row, self._tracks, self._headings, offsets, out)
        return out


FACINGS = 12
"""Directions that a body may face, as `best_by_direction` tells them apart."""


def best_by_direction(squares: NDArray[np.float64], yaw: NDArray[np.float64]) -> NDArray[np.int64]:
    """Places of the least of squares (n,) in each direction that yaw (n,) radians falls into; the least first."""
    direction = np.floor(np.mod(yaw, 2 * np.pi) * (FACINGS / (2 * np.pi))).astype(np.int64) % FACINGS
    order = np.argsort(squares, kind="stable")
    order = order[np.isfinite(squares[order])]
    return order[np.sort(np.unique(direction[order], return_index=True)[1])]


def planar_fit(model: NDArray[np.float64], seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """x, z metres and yaw radians (3,) that lay points (n, 3) best onto others (n, 3), moving on the floor only."""
    a, b = model - model.mean(axis=0), seen - seen.mean(axis=0)
    along = np.sum(a[:, 0] * b[:, 0] + a[:, 2] * b[:, 2])
    across = np.sum(a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2])
    yaw = np.arctan2(across, along)
    c, s = np.cos(yaw), np.sin(yaw)
    x, z = model.mean(axis=0)[[0, 2]]
    shift = seen.mean(axis=0)[[0, 2]] - np.array([c * x + s * z, c * z - s * x])
    return np.array([shift[0], shift[1], yaw])


@njit(cache=True)
def trajectory_kernel(row, tracks, headings, offsets, out):
    """Tracked joints (L, 6, 3) at `row + offsets`, seen from the heading frame of `row`."""
    cosine, sine = np.cos(headings[row, 2]), np.sin(headings[row, 2])
    for m in range(len(offsets)):
        at = row + offsets[m]
        yaw = headings[at, 2] - headings[row, 2]
        c, s = np.cos(yaw), np.sin(yaw)
        dx, dz = headings[at, 0] - headings[row, 0], headings[at, 1] - headings[row, 1]
        shift_x, shift_z = cosine * dx - sine * dz, sine * dx + cosine * dz
        for i in range(tracks.shape[1]):
            x, z = tracks[at, i, 0], tracks[at, i, 2]
            out[m, i, 0] = c * x + s * z + shift_x
            out[m, i, 1] = tracks[at, i, 1]
            out[m, i, 2] = c * z - s * x + shift_z


@njit(cache=True)
def match_kernel(rows, first, end, tracks, headings, offsets, seen, free, squares, yaws):
    """See `TrackerMatcher.squares`; the best place and facing leave both spreads less twice their product's length.

    yaws: (n,) radians that each row is turned by: 0 where it may not be.
    """
    moments, roles = seen.shape[0], seen.shape[1]
    model = np.empty((moments, roles, 3))
    n, u, v = 0, 0.0, 0.0
    for m in range(moments):
        for i in range(roles):
            if not np.isnan(seen[m, i, 0]):
                n, u, v = n + 1, u + seen[m, i, 0], v + seen[m, i, 2]
    n = max(n, 1)
    u, v = u / n, v / n
    for k in range(len(rows)):
        row = rows[k]
        if row + offsets.min() < first[k] or row + offsets.max() >= end[k]:
            squares[k], yaws[k] = np.inf, 0.0
            continue
        trajectory_kernel(row, tracks, headings, offsets, model)
        x, z = 0.0, 0.0
        for m in range(moments):
            for i in range(roles):
                if not np.isnan(seen[m, i, 0]):
                    x, z = x + model[m, i, 0], z + model[m, i, 2]
        x, z = x / n, z / n
        if not free:
            x, z = u, v
        total, along, across = 0.0, 0.0, 0.0
        for m in range(moments):
            for i in range(roles):
                if np.isnan(seen[m, i, 0]):
                    continue
                a, b = model[m, i, 0] - x, model[m, i, 2] - z
                c, d = seen[m, i, 0] - u, seen[m, i, 2] - v
                h = model[m, i, 1] - seen[m, i, 1]
                total += a * a + b * b + c * c + d * d + h * h
                along += a * c + b * d
                across += b * c - a * d
        squares[k] = total - 2 * (np.sqrt(along * along + across * across) if free else along)
        yaws[k] = np.arctan2(across, along) if free else 0.0
