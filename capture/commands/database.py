"""`sixpoint database build` and `sixpoint database info`."""

from pathlib import Path
from typing import Annotated

import typer


def build(
    paths: Annotated[list[Path], typer.Argument(help="Motion files (.bvh, .amc), or folders searched for them.")],
    out: Annotated[Path, typer.Option(help="The folder to make.")],
    fps: Annotated[float, typer.Option(min=10, max=240, help="Poses a second in the database.")] = 60.0,
    mirror: Annotated[bool, typer.Option("--mirror", help="Add each motion's mirror image.")] = False,
    neighbour_graph: Annotated[
        bool, typer.Option("--neighbour-graph", help="Add the paper's neighbour graph, for `--method paper`.")
    ] = False,
) -> None:
    """Index motions of one skeleton into a motion database.

    Files whose joints differ from the first one's are refused by name, and nothing is left half-written.
    """
    from capture.progress import progress_bar
    from reconstruction.database import build_database
    from reconstruction.motion_files import read_motion

    files = motion_files(paths)
    with progress_bar("building the database") as progress:
        database = build_database((read_motion(file) for file in files), out, fps, mirror, progress, count=len(files))
    if neighbour_graph:
        from reconstruction.paper_histories import add_neighbour_graph

        with progress_bar("linking neighbours") as progress:
            add_neighbour_graph(database, progress)
    print(f"{len(database)} poses of {len(database.clips)} motions in {out}")


def motion_files(paths: list[Path]) -> list[Path]:
    """The motion files among `paths` and anywhere inside its folders, sorted.

    Raises FileError naming a path that does not exist, or a folder that holds none.
    """
    from devices.errors import FileError
    from reconstruction.motion_files import MOTION_ENDINGS

    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise FileError(f"{path}: no such file or folder")
        inside = [f for f in path.rglob("*") if f.suffix.lower() in MOTION_ENDINGS] if path.is_dir() else [path]
        if not inside:
            raise FileError(f"{path}: no motion files in this folder; it takes {' and '.join(MOTION_ENDINGS)}")
        files += sorted(inside)
    return files


def info(
    database: Annotated[Path, typer.Argument(help="A folder made by `database build`.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Tell what is inside a motion database."""
    import json

    from reconstruction.database import open_database

    figures = open_database(database).info()
    if as_json:
        print(json.dumps(figures))
        return
    for name, value in figures.items():
        print(f"{name.replace('_', ' '):<20} {value}")
