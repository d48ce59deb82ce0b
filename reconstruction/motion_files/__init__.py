"""Motion capture files: BVH in and out, Acclaim ASF/AMC in."""

from pathlib import Path

from devices.errors import FileError
from reconstruction.motion import Motion
from reconstruction.motion_files.asf_amc import read_amc, read_asf
from reconstruction.motion_files.bvh import read_bvh, write_bvh

__all__ = ["MOTION_ENDINGS", "read_amc", "read_asf", "read_bvh", "read_motion", "write_bvh"]

MOTION_ENDINGS = (".bvh", ".amc")
"""The endings of files that hold a motion; an `.amc` is read with the `.asf` that belongs to it."""


def read_motion(path: str | Path) -> Motion:
    """The motion in a `.bvh` (centimetres) or `.amc` file, by its ending.

    Raises FileError naming file and line where the file is missing, broken, or of another kind.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending == ".bvh":
        return read_bvh(path)
    if ending == ".amc":
        return read_amc(path)
    raise FileError(f"{path}: not a motion file by its ending; use {' or '.join(MOTION_ENDINGS)}")
