"""Gate and smoothing change between two samples, by name."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.errors import SettingError
from devices.filters import OneEuroSettings
from devices.intake import DeviceIntake
from devices.intake_settings import INTAKE_SETTINGS, read_setting, write_setting
from devices.sample import TrackerSample


def at(intake, tick, x):
    """Where the intake says the head is when a device without a clock says x metres at that sixtieth."""
    found = intake.readings([TrackerSample("1", round(tick / 60 * 1e9), (x, 0.0, 0.0))])
    return [reading.position[0] for reading in found]


@given(st.sampled_from(sorted(INTAKE_SETTINGS)), st.floats(0, 1))
def test_what_is_written_is_read(key, share):
    intake, setting = DeviceIntake({"1": "head"}), INTAKE_SETTINGS[key]
    kind = type(read_setting(intake, key))
    value = share > 0.5 if kind is bool else setting.low + share * (setting.high - setting.low)
    if key == "accept_after":
        value = round(value)
    write_setting(intake, key, value)
    assert read_setting(intake, key) == value
    assert type(read_setting(intake, key)) is kind


def test_smoothing_is_off_until_it_is_switched_on_with_what_was_set_before():
    intake = DeviceIntake({"1": "head"})
    write_setting(intake, "min_cutoff_hz", 2.0)
    assert intake.smoothing == OneEuroSettings(min_cutoff_hz=2.0, on=False)
    write_setting(intake, "smooth", True)
    assert intake.smoothing == OneEuroSettings(min_cutoff_hz=2.0)


def test_a_filter_that_is_switched_on_again_begins_where_the_tracker_is():
    intake = DeviceIntake({"1": "head"}, smoothing=OneEuroSettings(0.5, 0.0))
    assert at(intake, 0, 0.0) == [0.0]
    assert at(intake, 1, 0.1)[0] < 0.02
    write_setting(intake, "smooth", False)
    assert at(intake, 2, 0.2) == [0.2]
    write_setting(intake, "smooth", True)
    assert at(intake, 3, 0.3) == [0.3]


def test_a_gate_takes_its_new_settings_with_the_next_sample():
    intake = DeviceIntake({"1": "head"})
    assert at(intake, 0, 0.0) == [0.0]
    assert at(intake, 1, 2.0) == []
    write_setting(intake, "gate", False)
    assert at(intake, 2, 2.0) == [2.0]
    write_setting(intake, "gate", True)
    write_setting(intake, "max_speed_m_s", 100.0)
    assert at(intake, 3, 1.0) == [1.0]
    assert intake.rejected == 1


def test_unknown_settings_list_the_known_ones():
    with pytest.raises(SettingError, match=r"'bata'.*beta"):
        read_setting(DeviceIntake({}), "bata")
    with pytest.raises(SettingError, match="above 0"):
        write_setting(DeviceIntake({}), "min_cutoff_hz", 0.0)
