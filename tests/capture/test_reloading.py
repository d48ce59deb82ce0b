"""A saved session.toml: live settings change at once, others are named, a broken file changes nothing."""

import os
import time

import pytest

from capture.config import DeviceConfig, SessionConfig, read_config
from capture.device_settings import device_settings
from capture.live import filters_of
from capture.reloading import ConfigReloader, reloading, settings_by_name
from capture.tuning import Tuning
from devices.intake import DeviceIntake
from devices.intake_settings import INTAKE_SETTINGS, read_setting

START = "[performer]\nheight_m = 1.7\n[[device]]\nname = 'suit'\nbeta = 60\n"


class Desk:
    """A session.toml being edited, and the session that watches it."""

    def __init__(self, folder):
        self.path, self.told = folder / "session.toml", []
        self.path.write_text(START)
        self.config = read_config(self.path)
        gate, smoothing = filters_of(self.config.device[0], filters_itself=False)
        self.intake = DeviceIntake({}, gate=gate, smoothing=smoothing)
        self.tuning = Tuning(device_settings("suit", self.intake))
        self.reloader = ConfigReloader(self.path, self.config, self.tuning, self.told.append)

    def save(self, text, looks=2):
        beside = self.path.with_suffix(".new")
        beside.write_text(text)
        os.replace(beside, self.path)
        for _ in range(looks):
            self.reloader.look()
        return self.tuning.apply()


@pytest.fixture
def desk(tmp_path):
    return Desk(tmp_path)


def test_a_live_setting_changes_at_once(desk):
    assert desk.save(START.replace("beta = 60", "beta = 10\nsmooth = false")) == {
        "device.suit.beta": 10.0,
        "device.suit.smooth": False,
    }
    assert desk.intake.smoothing.beta == 10
    assert "device.suit.beta is 10.0" in desk.told[0]


def test_a_key_that_is_left_out_again_is_its_default(desk):
    desk.save(START.replace("beta = 60", "beta = 10"))
    assert desk.save(START.replace("beta = 60", "")) == {"device.suit.beta": 60.0}


def test_what_cannot_change_while_live_is_named(desk):
    assert desk.save(START.replace("1.7", "1.8") + "port = '/dev/ttyUSB1'\n") == {}
    assert desk.told == ["session.toml: performer.height_m, device.suit.port: takes effect at the next start"]


@pytest.mark.parametrize(
    ("text", "where"), [(START.replace("60", "600"), ":5: device.0.beta"), (START + "beta =\n", "line 6")]
)
def test_a_broken_file_gives_its_line_and_changes_nothing(desk, text, where):
    assert desk.save(text) == {}
    assert where in desk.told[0]
    assert "the settings stay as they were" in desk.told[0]
    assert desk.save(START.replace("beta = 60", "beta = 10")) == {"device.suit.beta": 10.0}


def test_a_file_that_is_being_written_is_not_read(desk):
    assert desk.save("", looks=1) == {}
    assert desk.save(START.replace("beta = 60", "beta = 20")) == {"device.suit.beta": 20.0}
    assert len(desk.told) == 1


def test_a_file_that_is_gone_changes_nothing(desk):
    desk.path.unlink()
    for _ in range(3):
        desk.reloader.look()
    assert desk.told == []


def test_a_file_that_is_only_touched_says_nothing(desk):
    os.utime(desk.path, (1, 1))
    for _ in range(3):
        desk.reloader.look()
    assert desk.told == []


def test_it_is_watched_while_a_session_runs(desk):
    with reloading(desk.path, desk.config, desk.tuning, desk.told.append):
        desk.path.write_text(START.replace("beta = 60", "beta = 30"))
        end = time.monotonic() + 10
        while not desk.told and time.monotonic() < end:
            time.sleep(0.02)
    assert desk.tuning.apply() == {"device.suit.beta": 30.0}
    with reloading(None, desk.config, desk.tuning, desk.told.append):
        pass


def test_settings_of_a_device_are_those_that_change_live_and_have_their_ranges():
    for key, setting in INTAKE_SETTINGS.items():
        field = DeviceConfig.model_fields[key]
        bounds = {type(bound).__name__: bound for bound in field.metadata}
        if bounds:
            assert (bounds["Ge"].ge, bounds["Le"].le) == (setting.low, setting.high)
        gate, smoothing = filters_of(DeviceConfig(), filters_itself=False)
        assert read_setting(DeviceIntake({}, gate=gate, smoothing=smoothing), key) == (
            True if key == "smooth" else field.default
        )
        assert f"device.trackers.{key}" in settings_by_name(SessionConfig(device=(DeviceConfig(),)))
