"""Live settings: asked for at any time, applied between frames, kept in range."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from capture.tuning import LiveSetting, Tuning
from devices.errors import SettingError


class _Box:
    def __init__(self) -> None:
        self.delta, self.volume = 0.5, True

    def tuning(self) -> Tuning:
        return Tuning(
            (
                LiveSetting("character.delta", "softness", lambda: self.delta, lambda v: setattr(self, "delta", v)),
                LiveSetting("character.volume", "kept", lambda: self.volume, lambda v: setattr(self, "volume", v)),
            )
        )


def test_a_setting_changes_when_it_is_applied_and_not_before():
    box = _Box()
    tuning = box.tuning()
    tuning.ask("character.delta", 0.7)
    assert box.delta == 0.5
    assert tuning.value("character.delta") == 0.7
    assert tuning.apply() == {"character.delta": 0.7}
    assert box.delta == 0.7
    assert tuning.apply() == {}


def test_what_does_not_change_is_not_told():
    box = _Box()
    tuning = box.tuning()
    tuning.ask("character.volume", True)
    assert tuning.apply() == {}


@given(st.lists(st.integers(-5, 5)))
def test_steps_stay_in_range(steps):
    box = _Box()
    tuning = box.tuning()
    for step in steps:
        tuning.step("character.delta", step)
        tuning.apply()
        assert 0 <= box.delta <= 1


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("character.delta", 1.5, "from 0 to 1"),
        ("character.delta", True, "a number"),
        ("character.delta", float("nan"), "from 0 to 1"),
        ("character.volume", 3, "true or false"),
        ("character.detla", 0.5, "character.delta"),
    ],
)
def test_wrong_values_are_refused_with_what_would_be_right(name, value, says):
    with pytest.raises(SettingError, match=says):
        _Box().tuning().ask(name, value)
