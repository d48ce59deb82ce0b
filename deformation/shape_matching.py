"""Lattice shape matching: every region of the lattice fits its shape to where its particles are (paper IV-A, eq. 11).

A region of half-width w holds the particles within w cells along the lattice. The sums over all regions are w passes
from particles to the cells they are corners of and back, so that a region follows the body and costs the same at any
width; they count a particle by the number of ways to it, which tapers the regions where the paper's are boxes. The
transposed passes carry the regions' motions back to their particles, and so momentum is conserved exactly.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags

from deformation.kernel import kernel
from deformation.lattice import Lattice
from deformation.polar import polar_near_identity, polar_reference
from devices.errors import SettingError
from devices.frame import frozen

_WIDTH = 16
"""Numbers a particle carries through a pass: 15 moments, or 12 of a motion; a power of two suits vector units."""

WIDEST = 5
"""The largest region half-width."""


@dataclass(frozen=True, eq=False)
class Regions:
    """The shape matching regions of a lattice, one around each particle.

    cells: (C, 8) int32; corner_cells: (8 C,) int32 the cells of each particle in turn, from corner_first: (P + 1,) on.
    half_widths: (P,) int32, at least 1.
    shares: (P,) how much all regions count each particle, its mass in the exchange of momentum.
    """

    cells: NDArray[np.int32]
    corner_first: NDArray[np.int32]
    corner_cells: NDArray[np.int32]
    half_widths: NDArray[np.int32]
    shares: NDArray[np.float64]


def make_regions(lattice: Lattice, half_widths: NDArray[np.integer] | int = 2) -> Regions:
    """Regions of one half-width, or of one for each particle (P,). Raises SettingError outside 1 to 5."""
    widths = np.broadcast_to(np.asarray(half_widths, np.int32), len(lattice.particles)).copy()
    if not ((widths >= 1) & (widths <= WIDEST)).all():
        raise SettingError(f"region half-width {half_widths}: use 1 to {WIDEST}")
    shares = np.asarray(region_matrix(lattice.cells, widths).sum(axis=0)).ravel()
    corners = lattice.cells.reshape(-1)
    order = np.argsort(corners, kind="stable")
    first = np.searchsorted(corners[order], np.arange(len(lattice.particles) + 1))
    return Regions(
        lattice.cells,
        frozen(first.astype(np.int32)),
        frozen((order // 8).astype(np.int32)),
        frozen(widths),
        frozen(shares),
    )


def region_matrix(cells: NDArray[np.int32], half_widths: NDArray[np.int32]) -> csr_matrix:
    """(P, P): how much the region in each row counts each particle."""
    size = len(half_widths)
    rows = np.repeat(np.arange(len(cells)), 8)
    corner = csr_matrix((np.full(len(rows), 1 / 8), (rows, cells.reshape(-1))), shape=(len(cells), size))
    step = csr_matrix(corner.T @ corner)
    total, power = csr_matrix((size, size)), step
    for width in range(1, int(half_widths.max()) + 1):
        total = total + diags((half_widths == width).astype(float)) @ power
        power = csr_matrix(power @ step)
    return csr_matrix(total)


def goals_reference(
    positions: NDArray[np.float64], shape: NDArray[np.float64], regions: Regions
) -> NDArray[np.float64]:
    """Goal positions (P, 3) of eq. 11 in plain NumPy and SciPy; arguments as for `ShapeMatcher.goals`."""
    count = region_matrix(regions.cells, regions.half_widths)
    mass = np.asarray(count.sum(axis=1))
    centre, shape_centre = count @ positions / mass, count @ shape / mass
    products = np.einsum("pi,pj->pij", positions, shape).reshape(-1, 9)
    moment = (count @ products / mass).reshape(-1, 3, 3) - np.einsum("pi,pj->pij", centre, shape_centre)
    rotation = polar_reference(moment, np.broadcast_to(np.eye(3), moment.shape))
    shift = centre - np.einsum("pij,pj->pi", rotation, shape_centre)
    turns = (count.T @ rotation.reshape(-1, 9)).reshape(-1, 3, 3)
    return (np.einsum("pij,pj->pi", turns, shape) + count.T @ shift) / regions.shares[:, None]


class ShapeMatcher:
    """Finds goal positions, frame after frame, in buffers of its own."""

    def __init__(self, regions: Regions) -> None:
        self.regions = regions
        size = len(regions.half_widths)
        self._buffers = np.empty((3, size, _WIDTH))
        self._means = np.empty((len(regions.cells), _WIDTH))
        self._goals = np.empty((size, 3))

    def goals(self, positions: NDArray[np.float64], shape: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the regions' rigid motions take each particle (eq. 11): (P, 3) metres, valid until the next call.

        positions: (P, 3) metres, where the particles are; shape: (P, 3) metres, where they are at rest.
        """
        r = self.regions
        _goals(
            positions,
            shape,
            r.cells,
            r.corner_first,
            r.corner_cells,
            r.half_widths,
            r.shares,
            self._buffers,
            self._means,
            self._goals,
        )
        return self._goals


@kernel
def _pass(values, cells, corner_first, corner_cells, means, out):
    """out = A values: each cell takes the mean of its corners, each particle an eighth of each of its cells'."""
    for cell in range(len(cells)):
        a, b = values[cells[cell, 0]], values[cells[cell, 1]]
        c, d = values[cells[cell, 2]], values[cells[cell, 3]]
        e, f = values[cells[cell, 4]], values[cells[cell, 5]]
        g, h = values[cells[cell, 6]], values[cells[cell, 7]]
        mean = means[cell]
        for i in range(_WIDTH):
            mean[i] = 0.015625 * (((a[i] + b[i]) + (c[i] + d[i])) + ((e[i] + f[i]) + (g[i] + h[i])))
    for p in range(len(out)):
        total = out[p]
        for i in range(_WIDTH):
            total[i] = 0.0
        for n in range(corner_first[p], corner_first[p + 1]):
            mean = means[corner_cells[n]]
            for i in range(_WIDTH):
                total[i] += mean[i]


@kernel
def _goals(x, shape, cells, corner_first, corner_cells, half_widths, shares, buffers, means, goals):
    a, b, motion = buffers[0], buffers[1], buffers[2]
    size = len(x)
    for p in range(size):
        for i in range(3):
            a[p, i] = x[p, i]
            a[p, 3 + i] = shape[p, i]
            for j in range(3):
                a[p, 6 + 3 * i + j] = x[p, i] * shape[p, j]
        a[p, 15] = 1.0
    widest = half_widths.max()
    for width in range(1, widest + 1):
        _pass(a, cells, corner_first, corner_cells, means, b)
        a, b = b, a
        for p in range(size):
            if half_widths[p] == width:
                _fit(a[p], motion[p])
    for p in range(size):
        for i in range(_WIDTH):
            a[p, i] = 0.0
    for width in range(widest, 0, -1):
        for p in range(size):
            if half_widths[p] == width:
                for i in range(_WIDTH):
                    a[p, i] += motion[p, i]
        _pass(a, cells, corner_first, corner_cells, means, b)
        a, b = b, a
    for p in range(size):
        s = 1.0 / shares[p]
        m = a[p]
        for i in range(3):
            turned = m[3 * i] * shape[p, 0] + m[3 * i + 1] * shape[p, 1] + m[3 * i + 2] * shape[p, 2]
            goals[p, i] = s * (turned + m[9 + i])


@kernel
def _fit(sums, motion):
    """The rigid motion, nine of rotation and three of translation, that least squares finds from a region's moments."""
    s = 1.0 / sums[15]
    cx, cy, cz = s * sums[0], s * sums[1], s * sums[2]
    qx, qy, qz = s * sums[3], s * sums[4], s * sums[5]
    moment = (
        s * sums[6] - cx * qx,
        s * sums[7] - cx * qy,
        s * sums[8] - cx * qz,
        s * sums[9] - cy * qx,
        s * sums[10] - cy * qy,
        s * sums[11] - cy * qz,
        s * sums[12] - cz * qx,
        s * sums[13] - cz * qy,
        s * sums[14] - cz * qz,
    )
    found, r = polar_near_identity(moment)
    if not found:
        r = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    motion[0], motion[1], motion[2], motion[3], motion[4], motion[5], motion[6], motion[7], motion[8] = r
    motion[9] = cx - (r[0] * qx + r[1] * qy + r[2] * qz)
    motion[10] = cy - (r[3] * qx + r[4] * qy + r[5] * qz)
    motion[11] = cz - (r[6] * qx + r[7] * qy + r[8] * qz)
    for i in range(12, _WIDTH):
        motion[i] = 0.0
