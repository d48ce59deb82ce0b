"""`sixpoint database fetch`: motion capture from where it lives, made into a motion database."""

import json
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from capture.commands.options import AsJson
from devices.errors import choice_error
from replay_logs.atomic_file import check_folder_place

if TYPE_CHECKING:
    from capture.cmu_site import CmuMotion
    from capture.fetching import Cache

_SOURCES = ("cmu",)


def fetch(
    source: Annotated[str, typer.Argument(help="`cmu`: the CMU Graphics Lab Motion Capture Database.")],
    out: Annotated[
        Path | None, typer.Option(help="The database to make; by default called as the source and the actions.")
    ] = None,
    actions: Annotated[
        str | None, typer.Option(help="Only motions described by these words: walk,run,jump; all 1.1 GB otherwise.")
    ] = None,
    show: Annotated[bool, typer.Option("--list", help="List the motions there are, and fetch none of them.")] = False,
    fps: Annotated[float, typer.Option(min=10, max=240, help="Poses a second in the database.")] = 60.0,
    mirror: Annotated[bool, typer.Option("--mirror", help="Add each motion's mirror image.")] = False,
    cache: Annotated[
        Path | None, typer.Option(help="Where the files are kept; in your cache folder otherwise.")
    ] = None,
    site: Annotated[str | None, typer.Option(help="Another server with the same files.")] = None,
    as_json: AsJson = False,
) -> None:
    """Fetch motion capture from its own site, and build a motion database of it.

    Files come into a cache, one at a time, with their checksums; a fetch that broke off goes on where it was. Mind the
    licence that is shown.
    """
    import platformdirs

    from capture.cmu_site import LICENCE, SITE, chosen, fetch_index
    from capture.fetching import Cache
    from capture.progress import progress_bar, tell_all

    if source not in _SOURCES:
        raise choice_error("source", source, _SOURCES)
    words = [word for word in (actions or "").split(",") if word.strip()]
    out = out or Path("_".join([source, *(word.strip() for word in words)]).replace(" ", "-"))
    check_folder_place(out)
    tell_all([LICENCE])
    kept = Cache(cache or platformdirs.user_cache_path("sixpoint", appauthor=False) / source)
    address = (site or SITE).rstrip("/")
    with closing(kept):
        with progress_bar("index, KiB") as progress:
            motions = chosen(fetch_index(kept, address, progress), words)
        if show:
            _list(motions, as_json)
            return
        left_out = _fetched(motions, bool(words), kept, address)
    poses, clips = _built(motions, kept, out, fps, mirror, left_out)
    tell_all(left_out)
    figures = {"out": str(out), "poses": poses, "motions": clips, "left_out": left_out, "cache": str(kept.folder)}
    print(
        json.dumps(figures) if as_json else f"{poses} poses of {clips} motions in {out}; the files are in {kept.folder}"
    )


def _fetched(motions: list["CmuMotion"], by_action: bool, cache: "Cache", site: str) -> list[str]:
    """Brings the motions into the cache; tells what the site does not have."""
    from capture.cmu_site import fetch_archive, fetch_motions
    from capture.progress import progress_bar

    if by_action:
        with progress_bar(f"{len(motions)} motions, files") as progress:
            return list(fetch_motions(motions, cache, site, progress))
    with progress_bar("archive") as progress:
        fetch_archive(cache, site, progress)
    lacking = [motion for motion in motions if not (cache.folder / motion.amc).exists()]
    with progress_bar("what the archive lacks, files") as progress:
        return list(fetch_motions(lacking, cache, site, progress))


def _built(
    motions: list["CmuMotion"], cache: "Cache", out: Path, fps: float, mirror: bool, left_out: list[str]
) -> tuple[int, int]:
    """Poses and clips of the database that is made of them."""
    from capture.cmu_site import read_motions
    from capture.progress import progress_bar
    from reconstruction.database import build_database

    with progress_bar("building the database") as progress:
        read = read_motions(motions, cache.folder, left_out)
        database = build_database(read, out, fps, mirror, progress, count=len(motions))
    return len(database), len(database.clips)


def _list(motions: list["CmuMotion"], as_json: bool) -> None:
    if as_json:
        print(json.dumps([{"name": m.name, "fps": m.fps, "text": m.text} for m in motions]))
        return
    for motion in motions:
        print(f"{motion.name:<8} {motion.fps:>4.0f} Hz  {motion.text}")
