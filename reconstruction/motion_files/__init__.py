"""Motion capture files: BVH in and out."""

from pathlib import Path

from devices.errors import FileError
from reconstruction.motion import Motion
from reconstruction.motion_files.bvh import read_bvh, write_bvh

__all__ = ["MOTION_ENDINGS", "read_bvh", "read_motion", "write_bvh"]

MOTION_ENDINGS = (".bvh",)
"""The endings of files that hold a motion."""


def read_motion(path: str | Path) -> Motion:
    """The motion in a `.bvh` file, by its ending. Raises FileError where it is broken or of another kind."""
    path = Path(path)
    if path.suffix.lower() == ".bvh":
        return read_bvh(path)
    raise FileError(f"{path}: not a motion file by its ending; use {' or '.join(MOTION_ENDINGS)}")
