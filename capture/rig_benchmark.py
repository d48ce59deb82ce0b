"""The rigging paper's Table 1 beside ours: `sixpoint bench rig`.

Milliseconds, medians of one thread on our mannequin at about the paper's two sizes; reading the mesh from a file and
compiling (or fetching what was compiled) are told apart. `rays` is the paper's own way to the curves, its rays by
Open3D; `rig` is the whole of `rig_mesh`: distances, slices, fingers and names too, which have no column there.
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.table import Table

from deformation.auto_rig import RigSettings, rig_mesh
from deformation.beam import BeamSkin
from deformation.curve_skeleton import tube_rings
from deformation.inbetween_files import write_shapes
from deformation.isocurves import iso_curves, tubes
from deformation.mannequin import mannequin
from deformation.mesh import Mesh
from deformation.mesh_files import read_mesh
from reconstruction.standard_body import standard_skeleton

PAPER_MS = {"low": (7207, 1.32, 0.269, 1.517), "medium": (13201, 2.03, 0.431, 2.83)}
"""Vertices, identifying vertices on curves, creating the skeleton, deforming the skin: the cat and the dancer."""


def benchmark(rounds: int = 31) -> list[dict]:
    """One row a size: vertices, seconds of loading and of compiling, milliseconds by stage, and the paper's."""
    rows = []
    for resolution, paper in PAPER_MS.items():
        made, _ = mannequin(standard_skeleton(), resolution)
        mesh, load_s = _loaded(made)
        begin = time.perf_counter()
        rig_mesh(mesh)
        first_s = time.perf_counter() - begin
        stages = _stages(mesh, rounds)
        compile_s = max(first_s - stages["rig_ms"] / 1000, 0.0)
        row = {"vertices": len(mesh.vertices), "load_s": load_s, "compile_s": compile_s, "paper_ms": paper}
        rows.append(row | stages)
    return rows


def _loaded(mesh: Mesh) -> tuple[Mesh, float]:
    """The mesh by way of an OBJ file, and the seconds that reading it took."""
    with tempfile.TemporaryDirectory() as folder:
        write_shapes(mesh, [mesh.vertices], Path(folder) / "mesh")
        begin = time.perf_counter()
        read = read_mesh(Path(folder) / "mesh" / "0000.obj")
        return read, time.perf_counter() - begin


def _stages(mesh: Mesh, rounds: int) -> dict[str, float]:
    curves = iso_curves(mesh)
    chains = tubes(mesh, curves)
    skin = BeamSkin(curves, mesh.vertices, 1 / 60)
    still, out = np.zeros_like(mesh.vertices), np.empty_like(mesh.vertices)
    few = max(3, rounds // 6)
    by_rays = RigSettings(curves="rays")
    rig_ms = _median_ms(lambda: rig_mesh(mesh), few)
    return {
        "curves_ms": _median_ms(lambda: tubes(mesh, iso_curves(mesh)), rounds),
        "skeleton_ms": _median_ms(lambda: tube_rings(mesh.vertices, curves, chains), rounds),
        "step_ms": _median_ms(lambda: skin.step(still, still, out), rounds),
        "rig_ms": rig_ms,
        "rays_ms": max(_median_ms(lambda: rig_mesh(mesh, by_rays), few) - rig_ms, 0.0),
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
    for heading in ("vertices", "curves", "centres", "beam step", "rays", "whole rig", "compiling s", "loading s"):
        view.add_column(heading, justify="right")
    for row in rows:
        count, *paper = row["paper_ms"]
        pairs = zip((row["curves_ms"], row["skeleton_ms"], row["step_ms"]), paper, strict=True)
        cells = [f"{ours:.2f} ({theirs:.2f})" for ours, theirs in pairs]
        rest = [f"{row[name]:.0f}" for name in ("rays_ms", "rig_ms")]
        rest += [f"{row[name]:.1f}" for name in ("compile_s", "load_s")]
        view.add_row(f"{row['vertices']} ({count})", *cells, *rest)
    return view
