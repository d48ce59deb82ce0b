"""Whether a tracker slipped on its strap while its wearer was calibrated, by how much, and when.

A tracker that slips sits at one place of its joint's frame before a moment and at another after it, while the other
trackers, the body and the database go on saying where it should be. Both means are known from `Fit.alone`; whether
they differ is told by an F test against how much such distances vary from one second to the next in any case, since a
pose that the database does not know draws them aside for about as long (analysis of variance with one unknown change
point, the maximum over all).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.sample import ROLES
from reconstruction.body_fit import Fit

BLOCK = 5
"""Moments that are averaged before anything is compared: about a second, for which errors last."""
LEAST_BLOCKS = 2
"""On either side of a slip."""
CERTAIN_F = 25.0
"""Variance that a slip explains, over what is left, from which on it is believed: no honest calibration on motion
capture came above 21, four fifths of which were of people who move unlike all in the database."""
LEAST_M = 0.04
_TAIL = 6.0
"""As in `body_fit`: a moment that does not fit counts less."""


@dataclass(frozen=True)
class Slip:
    """role: whose tracker it is; time_s: when, as the moments count; metres: how far."""

    role: str
    time_s: float
    metres: float


def found_slip(fit: Fit, times: Sequence[float]) -> Slip | None:
    """The slip that explains most, or None where nothing speaks for one.

    times: (N,) seconds of the fit's last N moments, in order; earlier moments are not looked at.
    """
    best, slip = CERTAIN_F, None
    for number, role in enumerate(ROLES):
        apart, information = fit.alone[len(fit.alone) - len(times) :, number], fit.information[-len(times) :, number]
        there = np.isfinite(apart[:, 0])
        blocks = _Blocks.of(apart[there], information[there], np.asarray(times)[there])
        for split in range(LEAST_BLOCKS, len(blocks.times) - LEAST_BLOCKS + 1):
            metres, f = blocks.step(split)
            if f > best and metres > LEAST_M:
                best, slip = f, Slip(role, float(blocks.times[split]), metres)
    return slip


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Means of B runs of moments: information (B, 3, 3) and information times mean (B, 3); times: (B,) they begin."""

    information: NDArray[np.float64]
    weighted: NDArray[np.float64]
    times: NDArray[np.float64]

    @classmethod
    def of(cls, apart: NDArray[np.float64], information: NDArray[np.float64], times: NDArray[np.float64]) -> "_Blocks":
        pull = np.einsum("mab,mb->ma", information, apart)
        trust = (_TAIL + 3) / (_TAIL + np.einsum("ma,ma->m", apart, pull))
        first = np.linspace(0, len(times), len(times) // BLOCK, endpoint=False).astype(int)
        if not len(first):
            return cls(np.empty((0, 3, 3)), np.empty((0, 3)), np.empty(0))
        information = np.add.reduceat(information * trust[:, None, None], first)
        return cls(information, np.add.reduceat(pull * trust[:, None], first), times[first])

    def step(self, split: int) -> tuple[float, float]:
        """Metres between the means before and after a block, and F of there being two instead of one."""
        whole, _ = self._scatter(slice(None))
        before, mean_before = self._scatter(slice(0, split))
        after, mean_after = self._scatter(slice(split, None))
        left = (before + after) / (len(self.times) - 2)
        return float(np.linalg.norm(mean_after - mean_before)), (whole - before - after) / max(left, 1e-9)

    def _scatter(self, part: slice) -> tuple[float, NDArray[np.float64]]:
        """Weighted squares of blocks about their mean, and that mean (3,)."""
        information, weighted = self.information[part], self.weighted[part]
        mean = np.linalg.solve(information.sum(axis=0), weighted.sum(axis=0))
        off = np.linalg.solve(information, weighted[..., None])[..., 0] - mean
        return float(np.einsum("ba,bac,bc->", off, information, off)), mean
