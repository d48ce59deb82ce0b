"""What volume preservation is worth: losses in hard poses, plain linear blending beside ours; and the picture of it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.character import Character, LatticeSettings, mannequin_character
from deformation.deformer import Deformer, DeformSettings
from deformation.mesh import volume
from deformation.skinning import joint_motion, linear_blend
from deformation.surface import interpolate_reference
from deformation.volume import part_volumes
from reconstruction.kinematics import world_transforms
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

Turns = dict[str, tuple[float, float, float]]

HARD_POSES: dict[str, Turns] = {
    "elbows 90": {"left_lower_arm": (0, -90, 0), "right_lower_arm": (0, 90, 0)},
    "knee 90": {"left_lower_leg": (90, 0, 0)},
    "hip 90": {"left_upper_leg": (-90, 0, 0)},
    "forearm twist 150": {"left_hand": (150, 0, 0)},
    "deep squat": {
        "left_upper_leg": (-110, 0, 0),
        "right_upper_leg": (-110, 0, 0),
        "left_lower_leg": (120, 0, 0),
        "right_lower_leg": (120, 0, 0),
        "spine": (20, 0, 0),
    },
}
"""Rotation vectors in degrees, from the T-pose, by humanoid bone."""


def posed(skeleton: Skeleton, turns: Turns) -> NDArray[np.float64]:
    """(J, 4, 4) `T_world_joint` of a T-posed skeleton with humanoid bones turned by rotation vectors in degrees."""
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), 1))
    for bone, vector in turns.items():
        rotations[skeleton.humanoid[bone]] = Rotation.from_rotvec(vector, degrees=True).as_quat()
    return world_transforms(skeleton, skeleton.offsets[0], rotations)


def mannequin_report(resolution: str = "high", particles: int | None = None) -> list[dict]:
    """`volume_report` of the mannequin on the standard body."""
    settings = LatticeSettings(particles=particles)
    return volume_report(mannequin_character(standard_skeleton(), resolution, settings=settings))


def volume_report(character: Character) -> list[dict]:
    """A row a pose: relative changes of the worst part, of the lattice and of the mesh, and the smallest girth of the
    left forearm and hand against the rest pose; each for plain linear blending (`linear`) and for ours (`ours`)."""
    deformer = Deformer(character, DeformSettings(secondary=None))
    rows = []
    for name, turns in HARD_POSES.items():
        joints = posed(character.skeleton, turns)
        motion = joint_motion(joints, character.bind_inverse)
        linear = linear_blend(motion, character.binding, character.lattice.particles)
        ours = deformer.skin(joints).copy()
        rows.append(
            {"pose": name, "linear": _losses(character, linear, motion), "ours": _losses(character, ours, motion)}
        )
    return rows


def _losses(character: Character, particles: NDArray[np.float64], motion: NDArray[np.float64]) -> dict[str, float]:
    change = part_volumes(particles, character.parts) / character.parts.volumes - 1
    vertices = interpolate_reference(character.lattice, particles)
    return {
        "worst_part": float(change[np.abs(change).argmax()]),
        "lattice": float(change @ character.parts.volumes / character.parts.volumes.sum()),
        "mesh": volume(character.mesh.with_vertices(vertices)) / volume(character.mesh) - 1,
        "smallest_girth": _smallest_girth(character, vertices, motion),
    }


def _smallest_girth(character: Character, vertices: NDArray[np.float64], motion: NDArray[np.float64]) -> float:
    """The smallest ratio of mean radii about the left forearm's line, of slices a centimetre thick around the wrist."""
    names = character.skeleton.humanoid
    elbow, wrist = names["left_lower_arm"], names["left_hand"]
    start, end = character.bind[elbow, :3, 3], character.bind[wrist, :3, 3]
    length = float(np.linalg.norm(end - start))
    rest_along, rest_radius = _cylinder(character.mesh.vertices, start, (end - start) / length)
    turn, shift = motion[elbow, :, :3], motion[elbow, :, 3]
    _, radius = _cylinder(vertices, turn @ start + shift, turn @ (end - start) / length)
    own = np.isin(character.vertex_joints[:, 0], [elbow, wrist])
    slices = np.arange(0.6 * length, 1.15 * length, 0.01)
    ratios = []
    for low in slices:
        ring = own & (rest_along >= low) & (rest_along < low + 0.01)
        if ring.any():
            ratios.append(radius[ring].mean() / rest_radius[ring].mean())
    return float(min(ratios))


def _cylinder(
    points: NDArray[np.float64], start: NDArray[np.float64], direction: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far along a line, and how far from it, points (N, 3) are: (N,) metres each."""
    away = points - start
    along = away @ direction
    return along, np.linalg.norm(away - along[:, None] * direction, axis=1)


def volume_table(rows: Sequence[dict]) -> object:
    """A rich table of `volume_report`'s rows, in per cent."""
    from rich.table import Table

    view = Table(title="change against the rest pose, plain linear blending / ours", title_justify="left")
    for heading in ("pose", "worst part", "lattice", "mesh", "smallest girth of the wrist"):
        view.add_column(heading, justify="left" if heading == "pose" else "right")
    for row in rows:
        cells = [
            f"{100 * row['linear'][key]:+.1f} / {100 * row['ours'][key]:+.2f} %"
            for key in ("worst_part", "lattice", "mesh")
        ]
        girth = f"{row['linear']['smallest_girth']:.2f} / {row['ours']['smallest_girth']:.2f}"
        view.add_row(row["pose"], *cells, girth)
    return view
