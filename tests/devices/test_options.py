"""Options of devices: found by name, checked for their kind, the same from code, TOML, JSON and a command line."""

import json

import pytest

from devices.errors import SettingError
from devices.protocols import make_protocol, option_from_text, protocols


@pytest.mark.parametrize("name", protocols())
def test_options_make_the_same_protocol_again_after_json(name):
    protocol = make_protocol(name)
    assert make_protocol(name, **json.loads(json.dumps(protocol.options()))).options() == protocol.options()


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("fastrak", {"items": 5}, "option items of device fastrak is 5: it must be a list"),
        ("fastrak", {"binary": 1}, "option binary of device fastrak is 1: it must be true or false"),
        ("flock_of_birds", {"full_scale_in": "x"}, "is 'x': it must be a whole number"),
        ("generic", {"axes": 3}, "it must be text"),
        ("ndi", {"frame_hz": True}, "it must be a number"),
    ],
)
def test_a_value_of_the_wrong_kind_is_one_line(name, options, message):
    with pytest.raises(SettingError, match=message):
        make_protocol(name, **options)


def test_options_are_typed_as_in_toml():
    assert option_from_text("fob", "full_scale_in=144") == ("full_scale_in", 144)
    assert option_from_text("fob", "items = [2, 4, 1]") == ("items", [2, 4, 1])
    assert option_from_text("generic", "axes=FRD") == ("axes", "FRD")
    assert option_from_text("fastrak", "binary=false") == ("binary", False)
    assert make_protocol("ndi", **dict([option_from_text("ndi", "frame_hz=40")])).options()["frame_hz"] == 40.0
    with pytest.raises(SettingError, match="name=value"):
        option_from_text("fob", "full_scale_in")
