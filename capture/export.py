"""Motions out, by the ending of the file: BVH, animated GLB, VRM animation, CSV and NPZ; back in from the last two."""

import csv
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from capture.glb import write_glb
from capture.joint_presets import renamed
from capture.vrma import write_vrma
from deformation.character import Character
from devices.errors import FileError, choice_error
from devices.frame import frozen
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_files import write_bvh
from reconstruction.skeleton import Skeleton
from replay_logs.atomic_file import written_beside

__all__ = ["motion_writer", "read_csv", "read_npz", "write_csv", "write_glb", "write_motion", "write_npz", "write_vrma"]

_COLUMNS = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")


def write_motion(
    motion: Motion, path: str | Path, character: Character | None = None, joint_names: str | None = None
) -> None:
    """Writes a motion as its ending says: `.bvh`, `.glb`, `.vrma`, `.csv` or `.npz`, beside and renamed into place.

    character: who moves in a `.glb`; without one the mannequin does. joint_names: one of `capture.joint_presets`, or
    None to keep the skeleton's own; a `.vrma` has VRM's. Raises SettingError for another ending or preset, OSError.
    """
    write = motion_writer(path)
    if write is write_vrma:
        write_vrma(motion, path)
    elif write is write_glb:
        write_glb(character or _mannequin(motion), motion, path, joint_names=joint_names)
    else:
        write(motion if joint_names is None else renamed(motion, joint_names), path)


def motion_writer(path: str | Path) -> Callable[..., None]:
    """What writes a motion to such a path. Raises SettingError where its ending is none of ours: before work begins."""
    ending = Path(path).suffix.lower()
    if ending not in _WRITERS:
        raise choice_error("motion ending", ending, _WRITERS)
    return _WRITERS[ending]


def write_npz(motion: Motion, path: str | Path) -> None:
    """NumPy arrays `names`, `parents`, `offsets_m`, `root_positions_m`, `rotations_xyzw`, `fps` and `name`, exactly."""
    skeleton = motion.skeleton
    with written_beside(Path(path)) as part, part.open("wb") as file:
        np.savez_compressed(
            file,
            names=np.array(skeleton.names),
            parents=skeleton.parents,
            offsets_m=skeleton.offsets,
            root_positions_m=motion.root_positions,
            rotations_xyzw=motion.rotations,
            fps=np.array(motion.fps),
            name=np.array(motion.name),
        )


def read_npz(path: str | Path) -> Motion:
    """The motion that `write_npz` wrote, bit for bit (joint limits are not kept). Raises FileError."""
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
            skeleton = Skeleton(tuple(map(str, data["names"])), frozen(data["parents"]), frozen(data["offsets_m"]))
            positions, rotations = frozen(data["root_positions_m"]), frozen(data["rotations_xyzw"])
            return Motion(skeleton, positions, rotations, float(data["fps"]), str(data["name"]))
    except FileNotFoundError as error:
        raise FileError(f"{path}: no such file") from error
    except (KeyError, ValueError, zipfile.BadZipFile, EOFError) as error:
        raise FileError(f"{path}: not a motion that sixpoint wrote ({error})") from error


def write_csv(motion: Motion, path: str | Path) -> None:
    """One row a frame: `time_s`, then for each joint its world position and its local rotation.

    Columns are named `LeftHand.x_m` ... `LeftHand.qw`; positions in metres, rotations `R_parent_joint` (x, y, z, w).
    """
    positions, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    values = np.concatenate([positions, motion.rotations], axis=2).reshape(len(motion), -1)
    header = ["time_s", *(f"{name}.{column}" for name in motion.skeleton.names for column in _COLUMNS)]
    row = ",".join(["%.17g"] * values.shape[1])
    with written_beside(Path(path)) as part, part.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(header)
        for frame, numbers in enumerate(values):
            file.write(f"{frame / motion.fps:.17g},{row % tuple(numbers)}\n")


def read_csv(path: str | Path, skeleton: Skeleton) -> Motion:
    """The motion that `write_csv` wrote of this skeleton, exact to the last bit. Raises FileError."""
    path = Path(path)
    try:
        with path.open(encoding="utf-8", newline="") as file:
            header = next(csv.reader(file), [])
            values = np.array([line.split(",") for line in file], np.float64)
    except FileNotFoundError as error:
        raise FileError(f"{path}: no such file") from error
    except (ValueError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: not a table of numbers ({error})") from error
    expected = ["time_s", *(f"{name}.{column}" for name in skeleton.names for column in _COLUMNS)]
    if header != expected or values.shape[1:] != (len(expected),):
        raise FileError(f"{path}: the columns are not those of this skeleton's {len(skeleton)} joints")
    joints = values[:, 1:].reshape(len(values), len(skeleton), len(_COLUMNS))
    fps = (len(values) - 1) / float(values[-1, 0]) if len(values) > 1 else 60.0
    return Motion(skeleton, frozen(joints[:, 0, :3].copy()), frozen(joints[:, :, 3:].copy()), fps, path.stem)


def _mannequin(motion: Motion) -> Character:
    from deformation.character import mannequin_character

    return mannequin_character(motion.skeleton, reference=motion.pose(0))


_WRITERS: dict[str, Callable[..., None]] = {
    ".bvh": write_bvh,
    ".glb": write_glb,
    ".vrma": write_vrma,
    ".csv": write_csv,
    ".npz": write_npz,
}
