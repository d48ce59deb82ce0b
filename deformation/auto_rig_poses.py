"""One skeleton from several poses of one mesh: each joint as the pose shows it that bends it most (paper section 5)."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.auto_rig import AutoRig, RigNotFound, RigSettings, rig_mesh, with_joints
from deformation.curve_skeleton import MINIMAL_BEND, turn_between
from deformation.mesh import Mesh
from deformation.rig_templates import FINGER_NAMES
from devices.errors import SettingError
from reconstruction.skeleton import Skeleton

_AROUND = 1.5
"""Vertices so many times as far from a joint as the nearest one carry it from pose to pose."""

_FEWEST = 6
"""So many vertices at least."""

CHAINS = tuple(
    tuple(f"{side}_{joint}" for joint in chain)
    for side in ("left", "right")
    for chain in (
        ("upper_arm", "lower_arm", "hand", "hand_end"),
        ("upper_leg", "lower_leg", "foot", "toes", "toes_end"),
        *(
            ("hand", *(f"{finger}_{part}" for part in ("proximal", "intermediate", "distal", "distal_end")))
            for finger in FINGER_NAMES[1:]
        ),
        ("hand", *(f"thumb_{part}" for part in ("metacarpal", "proximal", "distal", "distal_end"))),
    )
)
"""Joints in the row in which they bend; the inner ones are decided pose by pose."""


def rig_poses(poses: Sequence[Mesh], settings: RigSettings | None = None) -> AutoRig:
    """The skeleton of the first pose, with the joints that others bend more, by 20 degrees at least, taken from these.

    poses: one or more of the same vertices in the same order; one that cannot be rigged, but the first, is left out and
    told. Raises RigNotFound for the first, SettingError for other vertex counts or none.
    """
    if not poses or any(pose.vertices.shape != poses[0].vertices.shape for pose in poses):
        counts = ", ".join(str(len(pose.vertices)) for pose in poses)
        raise SettingError(f"poses of {counts} vertices: use one or more of the same mesh")
    first, *others = poses
    base = rig_mesh(first, settings)
    found, notes = [(1, first, base)], []
    for number, pose in enumerate(others, start=2):
        try:
            found.append((number, pose, rig_mesh(pose, settings)))
        except RigNotFound as error:
            notes.append(f"pose {number} is left out: {error}")
    moved = {}
    for name, angles in _bends([rig for *_, rig in found]).items():
        best = int(np.argmax(angles))
        if best and angles[best] >= MINIMAL_BEND:
            number, pose, rig = found[best]
            place = rig.rig.bind[rig.rig.skeleton.names.index(name), :3, 3]
            moved[name] = carried(place, pose.vertices, first.vertices)
            notes.append(
                f"{name} from pose {number}, bent by {np.degrees(angles[best]):.0f} degrees there and by "
                f"{np.degrees(angles[0]):.0f} in the first"
            )
    return with_joints(base, moved, tuple(notes))


def carried(place: NDArray[np.float64], vertices: NDArray[np.float64], to: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) metres: a place in one pose, carried to another by the best rigid motion of the vertices around it.

    vertices, to: (V, 3) metres in both.
    """
    away = np.linalg.norm(vertices - place, axis=1)
    near = away <= max(_AROUND * away.min(), float(np.partition(away, _FEWEST)[_FEWEST]))
    before, after = vertices[near], to[near]
    turn = Rotation.align_vectors(after - after.mean(axis=0), before - before.mean(axis=0))[0].as_matrix()
    return after.mean(axis=0) + turn @ (place - before.mean(axis=0))


def _bends(rigs: Sequence[AutoRig]) -> dict[str, list[float]]:
    """Radians by which each pose bends a joint, for the inner joints of chains that all poses have."""
    bends: dict[str, list[float]] = {}
    for chain in CHAINS:
        present = [name for name in chain if all(name in rig.rig.skeleton.names for rig in rigs)]
        for (above, name), (_, below) in pairwise(pairwise(present)):
            bends[name] = [_bend(rig.rig.skeleton, rig.rig.bind[:, :3, 3], above, name, below) for rig in rigs]
    return bends


def _bend(skeleton: Skeleton, places: NDArray[np.float64], above: str, name: str, below: str) -> float:
    a, b, c = (places[skeleton.names.index(joint)] for joint in (above, name, below))
    return turn_between(b - a, c - b)
