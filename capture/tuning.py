"""Settings that can be changed while a session runs: asked for from any thread, applied between two frames.

Keys in the window, OSC messages and a saved `session.toml` all end here; the session's loop alone applies, so that no
stage ever sees a setting change under its hands, and the take can say exactly where it changed.
"""

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from devices.errors import SettingError, choice_error

Value = float | bool


@dataclass(frozen=True)
class LiveSetting:
    """One setting.

    name: its dotted key in `session.toml`, such as `character.delta`; text: what it does; unit: as shown, or empty.
    low, high: the range of a number; step: what one press of a key adds.
    read, write: called on the session's thread only; `write` gets a value of the right kind and range.
    """

    name: str
    text: str
    read: Callable[[], Value]
    write: Callable[[Value], None]
    unit: str = ""
    low: float = 0.0
    high: float = 1.0
    step: float = 0.1

    def checked(self, value: object) -> Value:
        """The value as the setting takes it. Raises SettingError saying what would be right."""
        if isinstance(self.read(), bool):
            if value not in (True, False):
                raise SettingError(f"{self.name}: true or false, not {value!r}")
            return bool(value)
        if isinstance(value, bool) or not isinstance(value, int | float) or not self.low <= value <= self.high:
            raise SettingError(f"{self.name}: a number from {self.low:g} to {self.high:g}, not {value!r}")
        return float(value)


class Tuning:
    """All live settings of a session by name."""

    def __init__(self, settings: Iterable[LiveSetting] = ()) -> None:
        self.settings: Mapping[str, LiveSetting] = {setting.name: setting for setting in settings}
        self._asked: dict[str, Value] = {}
        self._lock = threading.Lock()

    def value(self, name: str) -> Value:
        """What the setting is, or is about to be. Raises SettingError for an unknown name."""
        with self._lock:
            return self._asked[name] if name in self._asked else self._setting(name).read()

    def ask(self, name: str, value: object) -> None:
        """The setting changes with the next frame. Raises SettingError for an unknown name or a wrong value."""
        checked = self._setting(name).checked(value)
        with self._lock:
            self._asked[name] = checked

    def step(self, name: str, steps: int) -> None:
        """That many presses up or down, kept in range; a switch is turned over. Raises SettingError."""
        setting, value = self._setting(name), self.value(name)
        if isinstance(value, bool):
            self.ask(name, not value)
        else:
            self.ask(name, min(max(round(value + steps * setting.step, 9), setting.low), setting.high))

    def apply(self) -> dict[str, Value]:
        """Writes what was asked for, between two frames, and gives what changed."""
        with self._lock:
            asked, self._asked = self._asked, {}
        changed = {name: value for name, value in asked.items() if self.settings[name].read() != value}
        for name, value in changed.items():
            self.settings[name].write(value)
        return changed

    def _setting(self, name: str) -> LiveSetting:
        if name not in self.settings:
            raise choice_error("live setting", name, sorted(self.settings))
        return self.settings[name]
