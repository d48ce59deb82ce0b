"""Takes that begin and end while a session runs, and the marks in them."""

import time
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path

from capture.scene import Badge, Colour
from capture.session import Session
from capture.viewing import Action
from devices.errors import SixpointError
from replay_logs.recorder import TakeRecorder

_RED: Colour = (0.86, 0.16, 0.16)
_AMBER: Colour = (0.95, 0.60, 0.10)
_TOLD_S = 6.0
"""How long what went wrong stands in the picture."""
_BEGUN_S = 0.5
"""By then the session has taken up a take that was begun."""


class TakeDesk:
    """Begins takes in a folder and ends them, one at a time; every method may be called from any thread.

    begin: makes a recorder that knows the session and its devices, at a path.
    """

    def __init__(self, session: Session, begin: Callable[[Path], TakeRecorder], folder: Path) -> None:
        self._session, self._begin, self._folder = session, begin, folder
        self._recording: TakeRecorder | None = session.recorder
        self._since = time.monotonic()
        self._marks = 0
        self._trouble = ("", 0.0)

    @property
    def path(self) -> Path | None:
        """The take that is being made."""
        return self._recording.path if self._recording else None

    def actions(self) -> Mapping[str, Action]:
        """Its keys."""
        return {
            "R": Action("record: a new take, or the end of it", self.toggle),
            "M": Action("a mark in the take", self.mark),
        }

    def toggle(self) -> None:
        """Begins a take named by date and time, or ends the one that is being made."""
        if self._is_recording():
            self.stop()
        else:
            self.start()

    def start(self) -> None:
        """A new take from the next reading on; what prevents it is told in the picture, and the session goes on."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            recorder = self._begin(dated_take(self._folder))
        except (SixpointError, OSError) as error:
            self._trouble = (f"no take: {error}", time.monotonic())
            return
        self._recording, self._since, self._marks = recorder, time.monotonic(), 0
        self._session.record(recorder)

    def stop(self) -> None:
        """Finishes the take."""
        self._recording = None
        self._session.record(None)

    def mark(self, text: str | None = None) -> None:
        """Notes this moment; without a text it is numbered."""
        if not self._is_recording():
            self._trouble = ("no mark: nothing is being recorded (R)", time.monotonic())
            return
        self._marks += 1
        self._session.mark(text or f"mark {self._marks}")

    def badges(self) -> tuple[Badge, ...]:
        """What of it the picture shows: the take with its length, and what went wrong a moment ago."""
        shown = []
        if self._is_recording() and self.path is not None:
            seconds = int(time.monotonic() - self._since)
            marks = f", {self._marks} marks" if self._marks > 1 else ", 1 mark" if self._marks else ""
            shown.append(Badge(_RED, f"{self.path.name}  {seconds // 60:02d}:{seconds % 60:02d}{marks}"))
        words, when = self._trouble
        if words and time.monotonic() - when < _TOLD_S:
            shown.append(Badge(_AMBER, words))
        return tuple(shown)

    def _is_recording(self) -> bool:
        """Whether a take is being made; the session itself gives up one that cannot be written."""
        begun = time.monotonic() - self._since > _BEGUN_S
        if begun and self._session.recorder is not self._recording:
            self._recording = None
        return self._recording is not None


def dated_take(folder: Path) -> Path:
    """A path in the folder, named by date and time, at which there is nothing yet."""
    name = f"{datetime.now():%Y-%m-%d_%H-%M-%S}"
    path, number = folder / f"{name}.mcap", 2
    while path.exists():
        path, number = folder / f"{name}_{number}.mcap", number + 1
    return path
