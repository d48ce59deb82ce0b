"""Which character a name means, bound to the performer's skeleton."""

import numpy as np

from deformation.character import Character, mannequin_character
from devices.errors import choice_error
from reconstruction.database import MotionDatabase
from reconstruction.motion import Pose
from reconstruction.skeleton import Skeleton

MANNEQUIN = "mannequin"
RESOLUTIONS = ("low", "medium", "high")


def load_character(
    name: str, skeleton: Skeleton, resolution: str = "medium", reference: Pose | None = None
) -> Character:
    """The mannequin on that skeleton. reference: a pose that stands, for skeletons whose rest pose is none.

    Raises SettingError for an unknown character or resolution.
    """
    if name != MANNEQUIN:
        raise choice_error("character", name, (MANNEQUIN,))
    if resolution not in RESOLUTIONS:
        raise choice_error("mannequin resolution", resolution, RESOLUTIONS)
    return mannequin_character(skeleton, resolution, reference)


def average_pose(database: MotionDatabase, skeleton: Skeleton) -> Pose:
    """The database's mean pose on that body, at the origin and facing +Z."""
    mean = np.asarray(database.poses[:: max(1, len(database) // 2000)], np.float64).mean(axis=0)
    return database.space.with_skeleton(skeleton).pose(mean, np.zeros(3), 0.0)
