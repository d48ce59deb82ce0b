"""A body for any skeleton: landmarks, shape, quads, fitted in the bind pose."""

import numpy as np
from numpy.typing import NDArray

from deformation.bind_pose import bind_pose
from deformation.mannequin.body import body_field
from deformation.mannequin.cage import corner_positions, outer_faces
from deformation.mannequin.fitting import Patchwork, corner_grids, divide, relax, unfold
from deformation.mannequin.landmarks import landmarks
from deformation.mesh import Mesh, all_quads
from devices.errors import choice_error
from devices.frame import frozen
from reconstruction.kinematics import world_joints, world_transforms
from reconstruction.motion import Pose
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

RESOLUTIONS = ("low", "medium", "high")
"""About 7,000, 13,000 and 28,000 vertices."""

_LENGTHWISE = {
    "torso 0": 5, "torso 1": 3, "torso 2": 7, "torso 3": 4, "torso 4": 2, "torso 5": 3, "torso 6": 7, "torso 7": 4,
    "leg 0": 6, "leg 1": 12, "leg 2": 5, "leg 3": 5, "leg 4": 12, "leg 5": 2, "leg 6": 2, "foot 0": 5, "foot 1": 4,
    "arm 0": 4, "arm 1": 9, "arm 2": 4, "arm 3": 11, "arm 4": 2, "arm 5": 3, "arm 6": 1,
    "finger 0": 3, "finger 1": 4, "thumb 0": 3, "thumb 1": 3,
}  # fmt: skip
_AROUND = {"column": 3, "depth": 2}
_SCALE = {"low": 1.0, "medium": 1.33, "high": 2.0}
_COARSE_STILL = ("finger", "foot")
"""Parts too slender for the coarse rounds: they would shrink into their roots."""
_WEBBED = ("hand", "finger")
"""Parts whose narrow webs the last rounds may fold."""


def mannequin(
    skeleton: Skeleton, resolution: str = "medium", reference: Pose | None = None
) -> tuple[Mesh, NDArray[np.float64]]:
    """The mesh of a body around a skeleton in its bind pose, and the joints' `T_world_joint` (J, 4, 4) there.

    The mesh is closed, all quads, of one piece without handles, faces outward, feet on y = 0, facing +Z. `reference` is
    a pose of the skeleton's motion, needed where its rest pose is no pose of a person (see `bind_pose`).
    Raises SettingError for an unknown resolution, SixpointError for a skeleton without arms or legs.
    """
    if resolution not in RESOLUTIONS:
        raise choice_error("resolution", resolution, RESOLUTIONS)
    transforms = world_transforms(skeleton, *bind_pose(skeleton, reference))
    body = landmarks(skeleton, transforms[:, :3, 3])
    positions = corner_positions(body)
    faces, field = outer_faces(positions), body_field(body)
    shapes = corner_grids(faces, positions)
    coarser, finest = _scales(resolution)
    for scale in coarser:
        shapes = relax(divide(faces, shapes, _counts(scale)), field, rounds=15, still=_COARSE_STILL).shapes()
    patches = unfold(relax(divide(faces, shapes, _counts(finest)), field, rounds=6), field, _WEBBED)
    return all_quads(patches.vertices, patches.quads()), frozen(transforms)


def undressed(resolution: str) -> Patchwork:
    """The divided figure around the standard skeleton before it is fitted: every mannequin has the same faces."""
    skeleton = standard_skeleton()
    positions = corner_positions(landmarks(skeleton, world_joints(skeleton, *bind_pose(skeleton))[0]))
    faces = outer_faces(positions)
    return divide(faces, corner_grids(faces, positions), _counts(_SCALE[resolution]))


def _scales(resolution: str) -> tuple[list[float], float]:
    """Coarse to fine: vertices spread over long ways while they are few."""
    finest = _SCALE[resolution]
    return [scale for scale in (0.5, 1.0) if scale < finest], finest


def _counts(scale: float) -> dict[str, int]:
    return {name: max(1, round(scale * n)) for name, n in (_LENGTHWISE | _AROUND).items()}
