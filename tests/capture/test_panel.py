import pytest
from hypothesis import given
from hypothesis import strategies as st

from capture.panel import MOST_ROWS, TuningPanel
from capture.tuning import LiveSetting, Tuning
from capture.viewing import Controls, Playback


def tuned(count=3):
    """A tuning of some numbers and a switch, and what it writes to."""
    held = {f"part.number{n}": 0.5 for n in range(count)} | {"part.on": True}

    def setting(name):
        return LiveSetting(name, f"about {name}", lambda: held[name], lambda value: held.update({name: value}), "Hz")

    return Tuning(map(setting, held)), held


def test_tab_opens_it_and_shows_every_setting_with_unit_and_range():
    panel = TuningPanel(tuned()[0])
    assert panel.panel() is None
    controls = Controls(actions=panel.actions())
    controls.press("Tab")
    shown = panel.panel()
    assert [row.name for row in shown.rows] == ["part.number0", "part.number1", "part.number2", "part.on"]
    assert [row.value for row in shown.rows] == ["0.5 Hz"] * 3 + ["on"]
    assert [row.share for row in shown.rows] == [0.5, 0.5, 0.5, None]
    assert shown.foot == ("about part.number0", "0 to 1 Hz, at first 0.5")


def test_keys_change_the_chosen_setting_from_the_next_frame_on():
    tuning, held = tuned()
    controls = Controls(actions=TuningPanel(tuning).actions())
    for key in ("Tab", "Down", "Right", "Right", "Left", "Right"):
        controls.press(key)
    assert held["part.number1"] == 0.5
    assert tuning.apply() == {"part.number1": pytest.approx(0.7)}
    controls.press("Backspace")
    tuning.apply()
    assert held["part.number1"] == 0.5


def test_a_closed_panel_leaves_the_arrows_to_the_recording():
    tuning, _ = tuned()
    controls = Controls(Playback(10.0), actions=TuningPanel(tuning).actions())
    controls.press("Right")
    assert controls.playback.time_s == 1.0
    controls.press("Tab")
    controls.press("Right")
    assert controls.playback.time_s == 1.0
    assert tuning.apply() == {"part.number0": pytest.approx(0.6)}


def test_switches_turn_over_either_way():
    tuning, held = tuned(0)
    panel = TuningPanel(tuning)
    panel.change(1)
    tuning.apply()
    assert held["part.on"] is False
    panel.change(-1)
    tuning.apply()
    assert held["part.on"] is True


@given(st.integers(1, 40), st.lists(st.sampled_from([-1, 1]), max_size=90))
def test_the_chosen_row_is_always_in_sight(count, steps):
    panel = TuningPanel(tuned(count)[0])
    panel.is_open = True
    for step in steps:
        panel.choose(step)
        shown = panel.panel()
        assert len(shown.rows) == min(count + 1, MOST_ROWS)
        assert shown.foot[0] == f"about {shown.rows[shown.chosen].name}"


def test_without_settings_there_is_no_panel():
    assert TuningPanel(Tuning()).actions() == {}
