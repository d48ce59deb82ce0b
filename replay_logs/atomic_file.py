"""Files that appear whole or not at all, and whether they can appear at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from devices.errors import FileError


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """Gives a path beside `path`, with its ending, to write to; renames it into place at the end, removes it on any
    exception. OSError is of `path`."""
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        if error.filename == str(part):
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise
    finally:
        part.unlink(missing_ok=True)


def check_file_place(path: Path) -> None:
    """Before anything slow: whether a file can be written there. Raises FileError."""
    if not path.parent.is_dir():
        raise FileError(f"{path}: the folder {path.parent} does not exist")
    if path.is_dir():
        raise FileError(f"{path}: a folder is there; name a file in it")
    _check_writable(path, path.parent)


def check_folder_place(path: Path) -> None:
    """Before anything slow: whether a folder is there or can be made, and be written into. Raises FileError."""
    there = next((above for above in (path, *path.parents) if above.exists()), Path())
    if not there.is_dir():
        what = "a file is there" if there == path else f"{there} is a file"
        raise FileError(f"{path}: {what}; name a folder")
    _check_writable(path, there)


def _check_writable(path: Path, folder: Path) -> None:
    if not os.access(folder, os.W_OK):
        raise FileError(f"{path}: the folder {folder} cannot be written to; name another place")
