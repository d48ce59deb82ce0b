"""The rigging paper's Table 1 beside ours: `sixpoint bench rig`.

Milliseconds, medians of one thread on our mannequin at about the paper's two sizes; compilation and the making of the
mesh are told apart. `rig` is the whole of `rig_mesh`: distances, slices and names too, which have no column there.
"""

import statistics
import time
from collections.abc import Callable

import numpy as np
from rich.table import Table

from deformation.auto_rig import rig_mesh
from deformation.beam import BeamSkin
from deformation.curve_skeleton import tube_rings
from deformation.isocurves import iso_curves, tubes
from deformation.mannequin import mannequin
from deformation.mesh import Mesh
from reconstruction.standard_body import standard_skeleton

PAPER_MS = {"low": (7207, 1.32, 0.269, 1.517), "medium": (13201, 2.03, 0.431, 2.83)}
"""Vertices, identifying vertices on curves, creating the skeleton, deforming the skin: the cat and the dancer."""


def benchmark(rounds: int = 31) -> list[dict]:
    """One row a size: vertices, `first_s` with compilation, milliseconds by stage, and the paper's."""
    rows = []
    for resolution, paper in PAPER_MS.items():
        begin = time.perf_counter()
        mesh, _ = mannequin(standard_skeleton(), resolution)
        made_s = time.perf_counter() - begin
        begin = time.perf_counter()
        rig_mesh(mesh)
        first_s = time.perf_counter() - begin
        rows.append({"vertices": len(mesh.vertices), "mesh_s": made_s, "first_s": first_s, "paper_ms": paper})
        rows[-1] |= _stages(mesh, rounds)
    return rows


def _stages(mesh: Mesh, rounds: int) -> dict[str, float]:
    curves = iso_curves(mesh)
    chains = tubes(mesh, curves)
    skin = BeamSkin(curves, mesh.vertices, 1 / 60)
    still, out = np.zeros_like(mesh.vertices), np.empty_like(mesh.vertices)
    return {
        "curves_ms": _median_ms(lambda: tubes(mesh, iso_curves(mesh)), rounds),
        "skeleton_ms": _median_ms(lambda: tube_rings(mesh.vertices, curves, chains), rounds),
        "step_ms": _median_ms(lambda: skin.step(still, still, out), rounds),
        "rig_ms": _median_ms(lambda: rig_mesh(mesh), max(3, rounds // 6)),
    }


def _median_ms(run: Callable[[], object], rounds: int) -> float:
    run()
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return 1000 * statistics.median(times)


def table(rows: list[dict]) -> Table:
    """Ours, and the paper's in brackets."""
    view = Table(title="milliseconds, ours (paper)", title_justify="left")
    for heading in ("vertices", "curves", "centres", "beam step", "whole rig", "first run s", "making the mesh s"):
        view.add_column(heading, justify="right")
    for row in rows:
        count, *paper = row["paper_ms"]
        pairs = zip((row["curves_ms"], row["skeleton_ms"], row["step_ms"]), paper, strict=True)
        cells = [f"{ours:.2f} ({theirs:.2f})" for ours, theirs in pairs]
        view.add_row(
            f"{row['vertices']} ({count})",
            *cells,
            f"{row['rig_ms']:.0f}",
            f"{row['first_s']:.1f}",
            f"{row['mesh_s']:.1f}",
        )
    return view
