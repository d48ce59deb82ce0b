"""Performers by name: their calibration profiles in the user's data folder."""

import os
from dataclasses import dataclass
from pathlib import Path

import platformdirs

from devices.errors import FileError, SettingError
from reconstruction.calibration import Profile

FOLDER_VARIABLE = "SIXPOINT_PROFILES"
"""Environment variable that puts the profiles into another folder."""


@dataclass(frozen=True)
class KnownPerformer:
    """A profile in the folder: its name and what it says of itself (`Profile`)."""

    name: str
    profile: Profile


def profiles_folder() -> Path:
    """Where named profiles live; it need not exist yet."""
    chosen = os.environ.get(FOLDER_VARIABLE)
    return Path(chosen) if chosen else platformdirs.user_data_path("sixpoint", appauthor=False) / "profiles"


def save_profile(name: str, profile: Profile) -> Path:
    """Keeps a profile under a name, in place of an older one of that name. Raises SettingError for a bad name."""
    path = _path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    profile.write(path)
    return path


def load_profile(name_or_path: str | Path) -> Profile:
    """The profile of that name, or in that file: what ends in `.json` or has a folder before it is a path.

    Raises FileError, which for an unknown name lists those there are.
    """
    return Profile.read(profile_path(name_or_path))


def profile_path(name_or_path: str | Path) -> Path:
    """Where the profile of that name is, or the path itself. Raises FileError for an unknown name."""
    text = str(name_or_path)
    if text.endswith(".json") or "/" in text or "\\" in text:
        return Path(text)
    path = _path(text)
    if not path.is_file():
        known = ", ".join(performer.name for performer in list_profiles()) or "none"
        raise FileError(f"no performer {text!r} (known: {known}); make one with 'sixpoint calibrate --name {text}'")
    return path


def list_profiles() -> list[KnownPerformer]:
    """All named profiles by name; files that are none are left out."""
    found = []
    for path in sorted(profiles_folder().glob("*.json")):
        try:
            found.append(KnownPerformer(path.stem, Profile.read(path)))
        except FileError:
            continue
    return found


def checked_name(name: str) -> str:
    """The name. Raises SettingError where it would not do as a file's."""
    if not name or name != name.strip() or not all(c.isalnum() or c in "-_ " for c in name):
        raise SettingError(f"performer's name {name!r}: use letters, digits, spaces, '-' and '_'")
    return name


def _path(name: str) -> Path:
    return profiles_folder() / f"{checked_name(name)}.json"
