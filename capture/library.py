"""Which motion database a name means: a folder, or the library that sixpoint makes itself on first use."""

from pathlib import Path

import platformdirs

from devices.progress import Progress, no_progress
from reconstruction.database import VERSION, MotionDatabase, build_database, open_database

LIBRARY = "library"
"""The name that stands for our own motion library."""


def open_named_database(name: str | Path = LIBRARY, progress: Progress = no_progress) -> MotionDatabase:
    """The database in that folder; for `library` our own, built into the user's cache the first time.

    Raises FileError where the folder is not a database.
    """
    if str(name) != LIBRARY:
        return open_database(Path(name))
    from reconstruction.motion_library import LIBRARY_VERSION, generate_library

    folder = platformdirs.user_cache_path("sixpoint", appauthor=False) / f"motion-library-{LIBRARY_VERSION}.{VERSION}"
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        return build_database(generate_library(progress=progress), folder, progress=progress)
    return open_database(folder)
