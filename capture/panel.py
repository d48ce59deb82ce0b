"""The live settings as the window shows them, walked and changed by keys."""

from collections.abc import Mapping
from dataclasses import dataclass

from capture.scene import Panel, PanelRow
from capture.tuning import LiveSetting, Tuning, Value
from capture.viewing import Action

MOST_ROWS = 16
"""So many settings are seen at once; the list moves with the chosen one."""


@dataclass(frozen=True)
class _Shown:
    """A setting with the value that it had when the panel was made."""

    setting: LiveSetting
    first: Value


class TuningPanel:
    """A panel over a `Tuning`: Tab opens and closes it, Up and Down choose, Left and Right change, Backspace undoes.

    Values are asked for, and hold from the next frame on, as `Tuning` has it.
    """

    def __init__(self, tuning: Tuning) -> None:
        self._tuning = tuning
        self._shown = [_Shown(setting, setting.read()) for setting in tuning.settings.values()]
        self.is_open = False
        self.chosen = 0

    def actions(self) -> Mapping[str, Action]:
        """Its keys; all but Tab are its own only while it is open. None where there is nothing to set."""
        if not self._shown:
            return {}
        return {
            "Tab": Action("settings: arrows choose and change, Backspace undoes", self._toggle),
            "Up": Action("", lambda: self.choose(-1), self._open),
            "Down": Action("", lambda: self.choose(1), self._open),
            "Left": Action("", lambda: self.change(-1), self._open),
            "Right": Action("", lambda: self.change(1), self._open),
            "Backspace": Action("", self.undo, self._open),
        }

    def choose(self, steps: int) -> None:
        """Goes down the list, round its end."""
        self.chosen = (self.chosen + steps) % len(self._shown)

    def change(self, steps: int) -> None:
        """The chosen setting by that many steps."""
        self._tuning.step(self._shown[self.chosen].setting.name, steps)

    def undo(self) -> None:
        """The chosen setting as it was at first."""
        shown = self._shown[self.chosen]
        self._tuning.ask(shown.setting.name, shown.first)

    def panel(self) -> Panel | None:
        """What the picture shows of it now; None while it is closed."""
        if not self.is_open:
            return None
        first = min(max(self.chosen - MOST_ROWS // 2, 0), max(len(self._shown) - MOST_ROWS, 0))
        seen = self._shown[first : first + MOST_ROWS]
        return Panel(tuple(self._row(s.setting) for s in seen), self.chosen - first, self._foot())

    def _row(self, setting: LiveSetting) -> PanelRow:
        value = self._tuning.value(setting.name)
        if isinstance(value, bool):
            return PanelRow(setting.name, "on" if value else "off")
        share = (value - setting.low) / ((setting.high - setting.low) or 1.0)
        return PanelRow(setting.name, f"{value + 0.0:.4g} {setting.unit}".rstrip(), share)

    def _foot(self) -> tuple[str, ...]:
        setting, first = self._shown[self.chosen].setting, self._shown[self.chosen].first
        if isinstance(first, bool):
            return setting.text, f"on or off, at first {'on' if first else 'off'}"
        unit = f" {setting.unit}" if setting.unit else ""
        return setting.text, f"{setting.low:g} to {setting.high:g}{unit}, at first {first:.4g}"

    def _toggle(self) -> None:
        self.is_open = not self.is_open

    def _open(self) -> bool:
        return self.is_open
