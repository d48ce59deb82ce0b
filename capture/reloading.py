"""A saved `session.toml` takes effect while the session runs, as far as it can."""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from capture.config import SessionConfig, read_config
from capture.tuning import Tuning
from devices.errors import SettingError, SixpointError

_LOOK_S = 0.25
"""How often the file is looked at; it is read when two looks in a row find it the same: editors write in steps."""

_Stamp = tuple[int, int, int] | None


class ConfigReloader:
    """Compares a file with what it was before, and asks for what changed.

    tell: called with one line for each thing a person should know. `look` is for one thread.
    """

    def __init__(self, path: Path, config: SessionConfig, tuning: Tuning, tell: Callable[[str], None]) -> None:
        self._path, self._tuning, self._tell = path, tuning, tell
        self._values = settings_by_name(config)
        self._read = self._seen = _stamp(path)

    def look(self) -> None:
        """One look: a file that was saved since, and is whole, is read."""
        seen, self._seen = self._seen, _stamp(self._path)
        if self._seen is None or self._seen == self._read or self._seen != seen:
            return
        self._read = self._seen
        try:
            config = read_config(self._path)
        except SixpointError as error:
            self._tell(f"{error}; the settings stay as they were")
            return
        self._take(settings_by_name(config))

    def _take(self, values: Mapping[str, object]) -> None:
        before, self._values = self._values, values
        changed = [name for name in {**before, **values} if before.get(name) != values.get(name)]
        later = [name for name in changed if not self._asked(name, values.get(name))]
        if later:
            self._tell(f"{self._path.name}: {', '.join(later)}: takes effect at the next start")
        now = [name for name in changed if name not in later]
        if now:
            self._tell(f"{self._path.name}: " + ", ".join(f"{name} is {values[name]}" for name in now))

    def _asked(self, name: str, value: object) -> bool:
        if name not in self._tuning.settings:
            return False
        try:
            self._tuning.ask(name, value)
        except SettingError:
            return False
        return True


def settings_by_name(config: SessionConfig) -> dict[str, object]:
    """Every setting by its dotted name; a device's by the device's name, such as `device.suit.beta`."""
    values: dict[str, object] = {}
    for section in SessionConfig.model_fields:
        if section == "device":
            for device in config.device:
                values |= {f"device.{device.name}.{key}": getattr(device, key) for key in type(device).model_fields}
        else:
            part = getattr(config, section)
            values |= {f"{section}.{key}": getattr(part, key) for key in type(part).model_fields}
    return values


@contextmanager
def reloading(path: Path | None, config: SessionConfig, tuning: Tuning, tell: Callable[[str], None]) -> Iterator[None]:
    """Watches the file, where there is one, on a thread of its own until the block ends."""
    if path is None:
        yield
        return
    reloader, ended = ConfigReloader(path, config, tuning, tell), threading.Event()

    def watch() -> None:
        while not ended.wait(_LOOK_S):
            reloader.look()

    thread = threading.Thread(target=watch, name="session.toml", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _stamp(path: Path) -> _Stamp:
    """What changes when a file is saved, or None where it is not there."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
