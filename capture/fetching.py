"""Files from the internet into a cache: whole, checked, and gone on with where a download broke off.

pooch keeps the cache and checks what is in it; the download itself, with HTTP's ranges (RFC 9110, section 14), is here,
as pooch begins anew each time.
"""

import json
import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from devices.errors import FileError
from devices.progress import Progress, no_progress
from replay_logs.atomic_file import written_beside

if TYPE_CHECKING:
    import requests

CHECKSUMS = "checksums.json"
"""SHA-256 by name of what was fetched into a cache: what comes or is found later must be the same."""
_PIECE = 1 << 16
_KIB = 1 << 10


@dataclass(frozen=True)
class Patience:
    """How long a server is waited for. timeout_s: without a byte; tries: without any progress, one after the other;
    pause_s: between them, longer each time."""

    timeout_s: float = 30.0
    tries: int = 4
    pause_s: float = 1.0


@dataclass
class Cache:
    """A folder of fetched files and their checksums. One file at a time, over one connection."""

    folder: Path
    patience: Patience = field(default_factory=Patience)
    _session: "requests.Session | None" = None

    def fetch(self, url: str, name: str, progress: Progress = no_progress) -> Path:
        """The file, from the cache where it is there and whole, else from the address.

        name: of the file in the cache, perhaps with folders. progress: in KiB. Raises FileError where it is not there,
        the server does not answer or breaks off again and again (what has come is kept, and gone on with the next
        time), or another file comes than the one that came before.
        """
        import pooch

        pooch.get_logger().setLevel(logging.ERROR)
        target = self.folder / name
        known = self.checksums().get(name)
        try:
            pooch.retrieve(url, known, target.name, target.parent, downloader=self._downloader(target, progress))
        except ValueError:
            raise FileError(
                f"{url}: another file than the one fetched before: its checksum is not the one in"
                f" {self.folder / CHECKSUMS}; if it was replaced on purpose, delete its line there"
            ) from None
        if known is None:
            self._remember(name, pooch.file_hash(target))
        return target

    def close(self) -> None:
        """Lets go of the connection."""
        if self._session is not None:
            self._session.close()
            self._session = None

    def checksums(self) -> Mapping[str, str]:
        """By name. Raises FileError where the list is broken."""
        path = self.folder / CHECKSUMS
        try:
            return dict(json.loads(path.read_text(encoding="utf-8")))
        except FileNotFoundError:
            return {}
        except ValueError:
            raise FileError(f"{path}: not a list of checksums; delete it to have it made anew") from None

    def _remember(self, name: str, checksum: str) -> None:
        with written_beside(self.folder / CHECKSUMS) as part:
            part.write_text(json.dumps({**self.checksums(), name: checksum}, indent=0), encoding="utf-8")

    def _downloader(self, target: Path, progress: Progress) -> Any:
        part = target.with_name(f"{target.name}.part")

        def download(url: str, output: str, _: object) -> None:
            self._complete(url, part, progress)
            part.replace(output)
            _etag_of(part).unlink(missing_ok=True)

        return download

    def _complete(self, url: str, part: Path, progress: Progress) -> None:
        """Goes on with the part until it is whole. Raises FileError."""
        import requests

        tries, reason = 0, ""
        while tries < self.patience.tries:
            before = _size(part)
            try:
                self._go_on(url, part, progress)
                return
            except (
                _Anew,
                requests.ConnectionError,
                requests.Timeout,
                requests.exceptions.ChunkedEncodingError,
            ) as error:
                reason = _in_short(error)
            tries = 1 if _size(part) > before else tries + 1
            time.sleep(self.patience.pause_s * tries)
        raise FileError(f"{url}: {reason}; {_size(part) // _KIB} KiB have come: run it again to go on from there")

    def _go_on(self, url: str, part: Path, progress: Progress) -> None:
        """One request, for what is missing yet. Raises FileError for what the server refuses, requests' exceptions."""
        have, etag = _size(part), _read_etag(part)
        # Only with a mark of what it is the beginning of can a part be gone on with.
        headers = {"Range": f"bytes={have}-", "If-Range": etag} if have and etag else {}
        headers["Accept-Encoding"] = "identity"
        with self._connection().get(url, headers=headers, stream=True, timeout=self.patience.timeout_s) as answer:
            if answer.status_code == 416:
                part.unlink(missing_ok=True)
                raise _Anew(f"{url}: the part in the cache was no part of it")
            if answer.status_code >= 500 or answer.status_code == 429:
                raise _Anew(f"the server answers {answer.status_code} {answer.reason}")
            if not answer.ok:
                raise FileError(f"{url}: the server answers {answer.status_code} {answer.reason}")
            have = have if answer.status_code == 206 else 0
            total = have + int(answer.headers.get("Content-Length", 0))
            part.parent.mkdir(parents=True, exist_ok=True)
            _etag_of(part).write_text(answer.headers.get("ETag") or answer.headers.get("Last-Modified") or "")
            with part.open("ab" if have else "wb") as file:
                for piece in answer.iter_content(_PIECE):
                    file.write(piece)
                    have += len(piece)
                    progress(have // _KIB, max(total, have) // _KIB)

    def _connection(self) -> "requests.Session":
        import requests

        if self._session is None:
            self._session = requests.Session()
            self._session.headers["User-Agent"] = f"sixpoint/{version('sixpoint')}"
        return self._session


class _Anew(Exception):
    """The server could not do it now; the next try may succeed."""


def _etag_of(part: Path) -> Path:
    return part.with_name(f"{part.name}.etag")


def _read_etag(part: Path) -> str:
    """What the server called the version that a part is of; nothing where that is not known, or weak."""
    try:
        etag = _etag_of(part).read_text()
    except OSError:
        return ""
    return "" if etag.startswith("W/") else etag


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _in_short(error: Exception) -> str:
    text = str(error).lower()
    if "timed out" in text or "timeout" in text:
        return "the server stopped answering"
    if isinstance(error, _Anew):
        return str(error)
    if "incompleteread" in text or "broken" in text or "aborted" in text or "reset" in text:
        return "the connection broke off"
    return "the server cannot be reached"
