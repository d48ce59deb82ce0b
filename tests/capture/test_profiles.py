import json

import numpy as np
import pytest

from capture.calibrating import report_profiles
from capture.profiles import FOLDER_VARIABLE, list_profiles, load_profile, profiles_folder, save_profile
from capture.solving import performer
from devices.errors import FileError, SettingError
from reconstruction.calibration import Profile
from reconstruction.mounting import Mounting


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "profiles"))


def anna(height_m: float = 1.62) -> Profile:
    return Profile({"stature": 0.93}, Mounting.at_the_joints(), 0.8, "good", height_m, "2026-11-22")


def test_a_performer_is_kept_by_name_and_found_again():
    assert list_profiles() == []
    path = save_profile("anna", anna())
    assert path.parent == profiles_folder()
    back = load_profile("anna")
    assert (back.scales, back.verdict, back.height_m, back.made) == (anna().scales, "good", 1.62, "2026-11-22")
    assert load_profile(path).height_m == 1.62
    save_profile("anna", anna(1.63))
    save_profile("ben", anna(np.nan))
    (profiles_folder() / "broken.json").write_text("{}")
    assert [p.name for p in list_profiles()] == ["anna", "ben"]


def test_the_list_tells_height_day_and_verdict(capsys):
    report_profiles(as_json=False)
    assert "sixpoint calibrate --name" in capsys.readouterr().out
    save_profile("anna", anna())
    report_profiles(as_json=False)
    assert capsys.readouterr().out.split() == ["anna", "1.62", "m", "2026-11-22", "good"]
    report_profiles(as_json=True)
    assert json.loads(capsys.readouterr().out)[0]["name"] == "anna"


@pytest.mark.parametrize("name", ["", "a/b", "..", "anna ", "a.b"])
def test_a_name_that_is_no_name_is_refused(name):
    with pytest.raises(SettingError, match="use letters"):
        save_profile(name, anna())


def test_an_unknown_name_lists_the_known_ones():
    save_profile("anna", anna())
    with pytest.raises(FileError, match="known: anna"):
        load_profile("bert")


def test_a_session_finds_its_performer_by_name(database):
    from reconstruction.database import open_database

    save_profile("anna", anna())
    assert performer(open_database(database), profile="anna").mounting is not None
