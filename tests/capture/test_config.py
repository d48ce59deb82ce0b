"""session.toml: defaults, what is written is read, and every wrong key named with its line."""

import pytest

from capture.config import DeviceConfig, SessionConfig, commented_config, read_config
from devices.errors import FileError, SettingError


def write(tmp_path, text):
    path = tmp_path / "session.toml"
    path.write_text(text)
    return path


def test_an_empty_file_is_the_defaults(tmp_path):
    assert read_config(write(tmp_path, "")) == SessionConfig()


def test_the_commented_configuration_reads_back_as_the_defaults(tmp_path):
    assert read_config(write(tmp_path, commented_config())) == SessionConfig(device=(DeviceConfig(),))


def test_every_key_of_the_commented_configuration_has_its_meaning():
    text = commented_config()
    for section in (SessionConfig().solver, SessionConfig().performer):
        for field in type(section).model_fields.values():
            assert field.description
            assert field.description in text


WRONG = [
    ("[performer]\nheight_m = 3.0\n", ":2: performer.height_m", "2.5"),
    ("[solver]\n\nrate = 60\n", ":3: unknown key 'solver.rate'", "rate_hz"),
    ("[[device]]\nname = 'a'\n[[device]]\nname = 'b'\nprt = 'x'\n", ":5: unknown key 'device.1.prt'", "port"),
    (
        "[[device]]\n[device.trackers]\n1 = 'hand'\n",
        ":3: device.0.trackers.1: unknown tracker role 'hand'",
        "left_wrist",
    ),
    ("[solver]\nmethod = 'magic'\n", ":2: solver.method", "paper"),
    ("wrong = 1\n", ":1: unknown key 'wrong'", "performer"),
]


@pytest.mark.parametrize(("text", "where", "right"), WRONG)
def test_a_wrong_key_is_named_with_its_line_and_what_would_be_right(tmp_path, text, where, right):
    with pytest.raises(SettingError) as error:
        read_config(write(tmp_path, text))
    assert where in str(error.value)
    assert right in str(error.value)


def test_all_wrong_keys_are_named_at_once(tmp_path):
    with pytest.raises(SettingError) as error:
        read_config(write(tmp_path, "[performer]\nheight_m = 9\n[solver]\nrate_hz = 'x'\n"))
    assert "height_m" in str(error.value)
    assert "rate_hz" in str(error.value)


def test_what_is_not_toml_is_refused_with_its_line(tmp_path):
    with pytest.raises(FileError, match="line 2"):
        read_config(write(tmp_path, "a = 1\nb = \n"))


def test_a_missing_file_says_how_to_make_one(tmp_path):
    with pytest.raises(FileError, match="config init"):
        read_config(tmp_path / "none.toml")
