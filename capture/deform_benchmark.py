"""How fast a character deforms: the paper's Table I with ours beside it, stage by stage, and NumPy's time to compare.

All figures are milliseconds a frame of one thread, in one process, on a motion that bends every limb. The frame is
timed on the wall and by the processor's clock, stages and NumPy by the latter alone: it does not count what else runs.
"""

import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from capture.latency import LatencyRecorder
from deformation.character import Character, LatticeSettings, make_character
from deformation.deformer import Deformer, DeformSettings
from deformation.mannequin import mannequin
from deformation.secondary_motion import SecondaryMotion, swing_reference
from deformation.shape_matching import goals_reference
from deformation.skinning import blend, blend_reference, joint_motion
from deformation.surface import Surface, interpolate_reference, normals_reference
from deformation.volume import part_volumes, preserve, preserve_reference
from devices.frame import frozen
from devices.progress import Progress, no_progress
from reconstruction.kinematics import world_transforms
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

PAPER_FPS = {1072: (148.572, 215.294), 1906: (92.717, 134.181), 2451: (61.684, 99.436), 3058: (42.376, 81.633)}
"""Table I: frames a second on a laptop and a desktop of 2010 by particles; 28,059 vertices, 38 joints, half-width 2."""

_SWINGS = {
    "Spine": (0.2, 0.3, 0.0),
    "LeftArm": (0.3, 0.4, -0.9),
    "RightArm": (0.3, -0.4, 0.9),
    "LeftForeArm": (0.6, -1.2, 0.0),
    "RightForeArm": (0.6, 1.2, 0.0),
    "LeftUpLeg": (-0.8, 0.0, 0.1),
    "RightUpLeg": (-0.8, 0.0, -0.1),
    "LeftLeg": (1.2, 0.0, 0.0),
    "RightLeg": (1.2, 0.0, 0.0),
    "Head": (0.2, 0.5, 0.0),
}
"""Rotation vectors that the benchmark's joints swing to and from."""

_PAPER_JOINTS = (
    ("LowerBack", "Hips", "Spine", 0.5),
    ("LHipJoint", "Hips", "LeftUpLeg", 0.5),
    ("RHipJoint", "Hips", "RightUpLeg", 0.5),
    ("LeftFingerBase", "LeftHand", "LeftHand_end", 0.4),
    ("LeftHandIndex1", "LeftFingerBase", "LeftHand_end", 0.5),
    ("RightFingerBase", "RightHand", "RightHand_end", 0.4),
    ("RightHandIndex1", "RightFingerBase", "RightHand_end", 0.5),
)
"""Joint, its parent, the parent's child that goes on from it, and how far on the way to that it is."""

_THUMBS = (("LThumb", "LeftHand", 1.0), ("RThumb", "RightHand", -1.0))
"""Joint, parent, side; each with an end."""

_DT_S = 1 / 60


def benchmark(
    particles: Sequence[int] = tuple(PAPER_FPS),
    resolution: str = "high",
    frames: int = 600,
    reference_frames: int = 3,
    progress: Progress = no_progress,
) -> list[dict]:
    """One row a lattice size: counts, `bind_s` (the search for the cell size included) and `bind_cpu_s`,
    `first_frame_s`, percentiles of `frame_ms` and of the processor's `frame_cpu_ms`, `stages_ms` medians, `numpy_ms`
    medians of the plain references, `worst_part_loss`, and the paper's `paper_fps`."""
    skeleton = paper_skeleton()
    mesh, bind = mannequin(skeleton, resolution)
    poses = swinging(skeleton, frames)
    rows = []
    for done, count in enumerate(particles):
        progress(done, len(particles))
        begin, begin_cpu = time.perf_counter(), time.process_time()
        character = make_character(mesh, skeleton, bind, settings=LatticeSettings(particles=count))
        bound = {"bind_s": time.perf_counter() - begin, "bind_cpu_s": time.process_time() - begin_cpu}
        rows.append(_row(character, poses, reference_frames) | bound | {"paper_fps": PAPER_FPS.get(count)})
    progress(len(particles), len(particles))
    return rows


def paper_skeleton(stature_m: float = 1.75) -> Skeleton:
    """Our standard body with the joints that CMU's skeletons have besides: 38, as many as the paper's."""
    body = standard_skeleton(stature_m)
    parents = {name: body.names[p] if p >= 0 else None for name, p in zip(body.names, body.parents, strict=True)}
    offsets = dict(zip(body.names, body.offsets, strict=True))
    for name, parent, child, way in _PAPER_JOINTS:
        parents |= {name: parent, child: name}
        offsets |= {name: way * offsets[child], child: (1 - way) * offsets[child]}
    for name, parent, side in _THUMBS:
        parents |= {name: parent, f"{name}_end": name}
        offsets |= {
            name: stature_m * np.array([0.015 * side, -0.005, 0.012]),
            f"{name}_end": stature_m * np.array([0.03 * side, -0.005, 0.02]),
        }
    return _skeleton(parents, offsets)


def _skeleton(parents: Mapping[str, str | None], offsets: Mapping[str, NDArray[np.float64]]) -> Skeleton:
    """Joints in an order in which parents come first."""
    order: list[str] = []

    def visit(name: str) -> None:
        order.append(name)
        for child, parent in parents.items():
            if parent == name:
                visit(child)

    visit(next(name for name, parent in parents.items() if parent is None))
    numbers = [-1 if (parent := parents[name]) is None else order.index(parent) for name in order]
    return Skeleton(tuple(order), frozen(np.array(numbers, np.int32)), frozen(np.array([offsets[n] for n in order])))


def swinging(skeleton: Skeleton, frames: int) -> NDArray[np.float64]:
    """(T, J, 4, 4) `T_world_joint` of every limb bending to and fro, each at its own pace."""
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(skeleton), 1))
    for number, (name, vector) in enumerate(_SWINGS.items()):
        swing = 0.5 - 0.5 * np.cos(np.arange(frames) * _DT_S * (3 + 0.4 * number))
        rotations[:, skeleton.names.index(name)] = Rotation.from_rotvec(swing[:, None] * vector).as_quat()
    return world_transforms(skeleton, np.tile(skeleton.offsets[0], (frames, 1)), rotations)


def _row(character: Character, poses: NDArray[np.float64], reference_frames: int) -> dict:
    begin = time.perf_counter()
    deformer = Deformer(character)
    deformer.deform(poses[0], _DT_S)
    first_frame_s = time.perf_counter() - begin
    whole, worst = LatencyRecorder(len(poses)), 0.0
    for pose in poses:
        begin_ns, begin_cpu_ns = time.perf_counter_ns(), time.thread_time_ns()
        deformer.deform(pose, _DT_S)
        whole.add("cpu", time.thread_time_ns() - begin_cpu_ns)
        whole.add("frame", time.perf_counter_ns() - begin_ns)
    times = whole.summary()
    for pose in poses[:: max(1, len(poses) // 40)]:
        volumes = part_volumes(deformer.skin(pose), character.parts)
        worst = max(worst, float(np.abs(volumes / character.parts.volumes - 1).max()))
    return {
        "particles": len(character.lattice.particles),
        "cells": len(character.lattice.cells),
        "vertices": len(character.mesh.vertices),
        "joints": len(character.skeleton),
        "first_frame_s": first_frame_s,
        "frame_ms": times["frame"],
        "frame_cpu_ms": times["cpu"],
        "stages_ms": _medians(_compiled(character), poses),
        "numpy_ms": _medians(_plain(character), poses[:reference_frames]),
        "worst_part_loss": worst,
    }


_Stages = dict[str, Callable[[NDArray[np.float64]], None]]


def _medians(stages: _Stages, poses: NDArray[np.float64]) -> dict[str, float]:
    recorder = LatencyRecorder(len(poses))
    for pose in poses:
        for name, run in stages.items():
            begin = time.process_time_ns()
            run(pose)
            recorder.add(name, time.process_time_ns() - begin)
    return {name: row["p50"] for name, row in recorder.summary().items()}


def _compiled(character: Character) -> _Stages:
    """The deformer's stages one by one, on buffers of their own."""
    lattice, settings = character.lattice, DeformSettings()
    surface, flesh = Surface(character.mesh, lattice), SecondaryMotion(character.regions, character.softness, 1.0)
    x, shown, turns = (
        np.empty_like(lattice.particles),
        np.empty_like(lattice.particles),
        np.empty((len(lattice.particles), 3, 3)),
    )
    vertices, normals = np.empty_like(character.mesh.vertices), np.empty_like(character.mesh.vertices)
    assert settings.secondary is not None
    swing = settings.secondary
    return {
        "skinning": lambda pose: blend(
            joint_motion(pose, character.bind_inverse), character.binding, lattice.particles, x, turns
        ),
        "volume": lambda _: preserve(x, turns, character.parts, lattice.cell_size),
        "secondary": lambda _: flesh.follow(x, _DT_S, swing, shown),
        "vertices": lambda _: surface.vertices(shown, vertices),
        "normals": lambda _: surface.normals(vertices, normals),
    }


def _plain(character: Character) -> _Stages:
    """The same in plain NumPy and SciPy."""
    lattice, settings, regions = character.lattice, DeformSettings(), character.regions
    held: dict[str, NDArray[np.float64]] = {"v": np.zeros_like(lattice.particles)}
    assert settings.secondary is not None
    swing = settings.secondary

    def skin(pose: NDArray[np.float64]) -> None:
        motion = joint_motion(pose, character.bind_inverse)
        held["x"], held["turns"] = blend_reference(motion, character.binding, lattice.particles)

    def volume(_: NDArray[np.float64]) -> None:
        held["x"] = preserve_reference(held["x"], held["turns"], character.parts, lattice.cell_size)

    def secondary(_: NDArray[np.float64]) -> None:
        skin, v = held["x"], held["v"]
        goals = goals_reference(skin, skin, regions)
        held["shown"], held["v"] = swing_reference(skin, v, skin, v, goals, character.softness, swing, 1.0)

    def vertices(_: NDArray[np.float64]) -> None:
        held["vertices"] = interpolate_reference(lattice, held["shown"])

    def normals(_: NDArray[np.float64]) -> None:
        held["normals"] = normals_reference(character.mesh, held["vertices"])

    return {"skinning": skin, "volume": volume, "secondary": secondary, "vertices": vertices, "normals": normals}


def table(rows: Sequence[dict]) -> object:
    """A rich table of `benchmark`'s rows: Table I with ours beside it."""
    from rich.table import Table

    stages = list(rows[0]["stages_ms"])
    title = f"milliseconds a frame, {rows[0]['vertices']:,} vertices, {rows[0]['joints']} joints, half-width 2"
    view = Table(title=title, title_justify="left")
    headings = ["particles", *stages, "frame p50", "p99", "cpu p50", "p99", "NumPy", "faster", "bind", "fps", "paper's"]
    for heading in headings:
        view.add_column(heading, justify="right")
    for row in rows:
        frame, cpu, plain = row["frame_ms"], row["frame_cpu_ms"], sum(row["numpy_ms"].values())
        paper = f"{row['paper_fps'][1]:.0f}" if row["paper_fps"] else ""
        cells = [f"{row['stages_ms'][stage]:.2f}" for stage in stages]
        cells += [f"{times[p]:.2f}" for times in (frame, cpu) for p in ("p50", "p99")]
        cells += [f"{plain:.1f}", f"{plain / cpu['p50']:.0f}x", f"{row['bind_cpu_s']:.2f} s"]
        view.add_row(str(row["particles"]), *cells, f"{1000 / frame['p50']:.0f}", paper)
    return view
