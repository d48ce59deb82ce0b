"""CMU's motion capture database where it lives: its index, its files, and what it asks of those who use it.

Addresses and the form of the index page are those of mocap.cs.cmu.edu; it does not speak HTTPS. Its index names for
each motion what is done and the frame rate, which AMC files do not hold. The site asks not to be crawled: whole, it is
fetched as the one archive that it offers; by action, one file at a time.
"""

import re
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

from capture.fetching import Cache
from devices.errors import FileError, SettingError
from devices.progress import Progress, no_progress
from reconstruction.motion import Motion
from reconstruction.motion_files.asf_amc import CMU_FPS, read_amc
from replay_logs.atomic_file import written_beside

SITE = "http://mocap.cs.cmu.edu"
ARCHIVE = "allasfamc.zip"
"""All skeletons and motions, 1.1 GB."""
LICENCE = (
    "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu: free for research and, in products, for sale;"
    " the data itself may not be resold, converted or not. Who publishes results is asked to send the citation to"
    ' jkh+mocap@cs.cmu.edu and to acknowledge: "The data used in this project was obtained from mocap.cs.cmu.edu.'
    ' The database was created with funding from NSF EIA-0196217."'
)
_INDEX = "/search.php?subjectnumber=%25&motion=%25"
_AMC = re.compile(r"/subjects/(\d+)/(\d+_\d+)\.amc$", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class CmuMotion:
    """One motion. name: `35_01`; subject: `35`; text: what is done; fps: frames a second."""

    name: str
    subject: str
    text: str
    fps: float

    @property
    def asf(self) -> str:
        """Its skeleton's place on the site and in the cache."""
        return f"subjects/{self.subject}/{self.subject}.asf"

    @property
    def amc(self) -> str:
        """Its own."""
        return f"subjects/{self.subject}/{self.name}.amc"


def fetch_index(cache: Cache, site: str = SITE, progress: Progress = no_progress) -> list[CmuMotion]:
    """All motions that the site lists, by name. Raises FileError where the page names none."""
    page = cache.fetch(f"{site}{_INDEX}", "index.html", progress)
    motions = parse_index(page.read_text(encoding="utf-8", errors="replace"))
    if not motions:
        raise FileError(f"{page}: no motions are listed there; has the site changed? Delete the file to fetch it anew")
    return motions


def parse_index(html: str) -> list[CmuMotion]:
    """The motions of the index page: cells of a number, a description, links to its files, and its frame rate."""
    cells = _Cells()
    cells.feed(html)
    motions = {}
    for at, cell in enumerate(cells.found):
        link = next((match for href in cell.links if (match := _AMC.search(href))), None)
        if link is not None:
            subject, name = link.groups()
            motions[name] = CmuMotion(name, subject, _text_before(cells.found, at), _rate_after(cells.found, at))
    return [motions[name] for name in sorted(motions, key=_in_numbers)]


def chosen(motions: Sequence[CmuMotion], actions: Sequence[str]) -> list[CmuMotion]:
    """Those whose description has a word that begins like one of the actions; all where there are none.

    Raises SettingError naming an action that no motion has.
    """
    found: list[CmuMotion] = []
    for action in actions:
        word = re.compile(rf"\b{re.escape(action.strip())}", re.IGNORECASE)
        own = [motion for motion in motions if word.search(motion.text)]
        if not own:
            words = sorted({word for motion in motions for word in re.findall(r"[a-z]{4,}", motion.text.lower())})
            raise SettingError(f"no motion is described by {action!r}; there are {', '.join(words[:40])} ...")
        found += own
    return list(dict.fromkeys(found)) if actions else list(motions)


def fetch_motions(
    motions: Sequence[CmuMotion], cache: Cache, site: str = SITE, progress: Progress = no_progress
) -> Iterator[str]:
    """Fetches the motions and their skeletons one file after the other; progress in files.

    Gives, in a line each, those that the site lists and does not have. Raises FileError as `Cache.fetch`, but for that.
    """
    names = list(dict.fromkeys(name for motion in motions for name in (motion.asf, motion.amc)))
    for number, name in enumerate(names):
        progress(number, len(names))
        try:
            cache.fetch(f"{site}/{name}", name)
        except FileError as error:
            if " 404 " not in str(error):
                raise
            yield str(error)
    progress(len(names), len(names))


def fetch_archive(cache: Cache, site: str = SITE, progress: Progress = no_progress) -> None:
    """Fetches all motions as the site's archive and unpacks them into the cache; progress in KiB, then in files.

    Raises FileError as `Cache.fetch`, and where the archive is broken.
    """
    archive = cache.fetch(f"{site}/{ARCHIVE}", ARCHIVE, progress)
    try:
        with zipfile.ZipFile(archive) as packed:
            inside = {
                name: at for name in packed.namelist() if (at := re.search(r"subjects/\d+/[\d_]+\.(asf|amc)$", name))
            }
            for number, (name, place) in enumerate(inside.items()):
                _unpack(packed, name, cache.folder / place[0])
                progress(number + 1, len(inside))
    except zipfile.BadZipFile as error:
        raise FileError(f"{archive}: {error}; delete it to fetch it anew") from None


def _unpack(packed: zipfile.ZipFile, name: str, target: Path) -> None:
    """Unless it is there already, of the same size; zip checks what it reads."""
    if target.exists() and target.stat().st_size == packed.getinfo(name).file_size:
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with written_beside(target) as part:
        part.write_bytes(packed.read(name))


def read_motions(motions: Sequence[CmuMotion], folder: Path, left_out: list[str]) -> Iterator[Motion]:
    """The motions in a cache, each at its own rate. What is missing or broken is told in `left_out` and passed over, as
    is one whose joints are not the first one's."""
    tree: tuple[str, ...] | None = None
    for motion in motions:
        try:
            read = read_amc(folder / motion.amc, folder / motion.asf, motion.fps)
        except FileError as error:
            left_out.append(str(error))
            continue
        tree = tree or read.skeleton.names
        if read.skeleton.names != tree:
            left_out.append(f"{motion.name}: its skeleton has other joints than the first one's")
            continue
        yield read


@dataclass
class _Cell:
    text: str
    links: list[str]


class _Cells(HTMLParser):
    """The cells of all tables of a page in a row; the site does not close all its tags."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[_Cell] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in ("td", "th"):
            self.found.append(_Cell("", []))
        elif tag == "a" and self.found:
            self.found[-1].links += [value for name, value in attrs if name == "href" and value]

    def handle_data(self, data: str) -> None:
        if self.found:
            self.found[-1].text += data


def _text_before(cells: list[_Cell], at: int) -> str:
    """The last cell before that has text and no links."""
    before = (cell for cell in reversed(cells[:at]) if not cell.links and cell.text.strip())
    return " ".join(next(before, _Cell("", [])).text.split())


def _rate_after(cells: list[_Cell], at: int) -> float:
    """The first whole number in the cells after, up to the next motion; CMU's usual rate where there is none."""
    for cell in cells[at + 1 : at + 8]:
        if any(_AMC.search(link) for link in cell.links):
            break
        if not cell.links and cell.text.strip().isdigit() and float(cell.text) >= 10:
            return float(cell.text)
    return CMU_FPS


def _in_numbers(name: str) -> tuple[int, ...]:
    return tuple(int(part) for part in name.split("_"))
