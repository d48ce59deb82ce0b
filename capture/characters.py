"""Which character a name means, bound to a skeleton, and how the performer's poses become its own."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from capture.mannequin_cache import cached_mannequin
from capture.scene import CLAY
from deformation.character import Character, LatticeSettings, make_character
from deformation.character_files import Skin, bound_character, read_character
from deformation.example_files import examples_beside, with_examples
from deformation.painting import UNPAINTED, painting_beside, read_painting
from deformation.retarget import Retargeter
from devices.errors import choice_error
from reconstruction.database import MotionDatabase
from reconstruction.motion import Motion, Pose
from reconstruction.skeleton import Skeleton

MANNEQUIN = "mannequin"
RESOLUTIONS = ("low", "medium", "high")


@dataclass(frozen=True, eq=False)
class Cast:
    """A character in a performer's part.

    retargeter: carries the performer's poses to the character's skeleton; None where they share one.
    skin: what the file says of its surface, or None. notes: what was mended in the file, one line each.
    colours: (3,) or (V, 3) sRGB.
    """

    character: Character
    retargeter: Retargeter | None = None
    skin: Skin | None = None
    notes: tuple[str, ...] = ()
    colours: ArrayLike = CLAY

    def motion(self, motion: Motion) -> Motion:
        """The performer's motion on the character's skeleton."""
        return motion if self.retargeter is None else self.retargeter.motion(motion)

    def pose(self, pose: Pose) -> Pose:
        """The performer's pose on the character's skeleton."""
        return pose if self.retargeter is None else self.retargeter.pose(pose)


def cast(
    name: str,
    performer: Skeleton,
    resolution: str = "medium",
    reference: Pose | None = None,
    settings: LatticeSettings | None = None,
    examples: str | Path | None = None,
    painting: str | Path | None = None,
) -> Cast:
    """The mannequin on the performer's own skeleton, or a file: GLB, VRM, or OBJ and PLY with a rig beside.

    reference: a pose of the performer that stands, for skeletons whose rest pose is none. examples: a file of example
    shapes (`deformation.example_files`); otherwise what lies beside the character as `NAME.examples.toml`, if anything.
    painting: a file of what is painted on it (`deformation.painting`); otherwise `NAME.painting.npz` or `.toml` there.
    Raises SettingError for an unknown resolution, FileError for a file that is no character, no examples or painting of
    it.
    """
    if resolution not in RESOLUTIONS:
        raise choice_error("mannequin resolution", resolution, RESOLUTIONS)
    if name == MANNEQUIN:
        body = cached_mannequin(performer, resolution, reference)
        paint = read_painting(painting, performer, len(body.mesh.vertices)) if painting else UNPAINTED
        character = make_character(body.mesh, performer, body.bind, name, settings, paint)
        character = with_examples(character, examples) if examples else character
        return Cast(character, colours=body.colours)
    if not Path(name).suffix:
        raise choice_error("character", name, (MANNEQUIN, "the path of a .glb, .vrm, .obj or .ply file"))
    file = read_character(name)
    painting = painting or painting_beside(name)
    vertices = len(file.mesh.vertices)
    paint = read_painting(painting, file.rig.skeleton, vertices) if painting and file.rig else UNPAINTED
    character = bound_character(file, settings, painting=paint)
    examples = examples or examples_beside(name)
    character = with_examples(character, examples, file.placement) if examples else character
    retargeter = Retargeter(performer, character.skeleton, reference, target_bind=character.bind)
    return Cast(character, retargeter, file.skin, file.notes, file.skin.colours if file.skin else CLAY)


def average_pose(database: MotionDatabase, skeleton: Skeleton) -> Pose:
    """The database's mean pose on that body, at the origin and facing +Z."""
    mean = np.asarray(database.poses[:: max(1, len(database) // 2000)], np.float64).mean(axis=0)
    return database.space.with_skeleton(skeleton).pose(mean, np.zeros(3), 0.0)
