"""The `[character]` section: in the deformation, while running, and on the command line."""

import inspect
from dataclasses import dataclass

import numpy as np
import pytest
from pydantic import ValidationError

from capture.character_settings import character_settings, configured_cast, deform_settings, lattice_settings
from capture.commands.deform import deform
from capture.config import CharacterConfig, MaterialRegion
from capture.tuning import Tuning
from deformation.character import DEFAULT_PARTICLES, LatticeSettings, make_character
from deformation.deformer import DeformSettings
from deformation.live_deformer import LiveDeformer
from deformation.materials import MATERIAL_REGIONS, SOFTEST
from deformation.secondary_motion import SecondarySettings
from reconstruction.standard_body import standard_skeleton
from tests.deformation.bodies import two_legs


@dataclass
class Owner:
    deformer: LiveDeformer | None


@pytest.fixture
def owner() -> Owner:
    return Owner(LiveDeformer(make_character(*two_legs(), settings=LatticeSettings(particles=300))))


def test_what_stands_in_no_file_is_what_the_deformation_does_by_itself() -> None:
    look = CharacterConfig()
    assert deform_settings(look) == DeformSettings()
    assert lattice_settings(look) == LatticeSettings(particles=DEFAULT_PARTICLES)


def test_the_command_has_the_same_defaults() -> None:
    look = CharacterConfig()
    for name, parameter in inspect.signature(deform).parameters.items():
        if name in CharacterConfig.model_fields and name not in ("painting", "examples", "particles"):
            assert parameter.default == getattr(look, name), name


def test_the_whole_range_of_the_file_is_allowed() -> None:
    for bound in ("ge", "le"):
        values = {
            key: getattr(item, bound)
            for key, field in CharacterConfig.model_fields.items()
            for item in field.metadata
            if hasattr(item, bound)
        }
        deform_settings(CharacterConfig(**values, softness=dict.fromkeys(MATERIAL_REGIONS, SOFTEST)))  # type: ignore[arg-type]
    with pytest.raises(ValidationError):
        CharacterConfig(softness={"belly": SOFTEST + 0.1})


def test_regions_are_named_alike_everywhere() -> None:
    assert set(MATERIAL_REGIONS) == set(MaterialRegion.__args__)


def test_no_skin_no_settings() -> None:
    assert character_settings(Owner(None)) == []


def test_every_number_is_read_back_as_it_was_written(owner: Owner) -> None:
    tuning = Tuning(character_settings(owner))
    changed = {
        "character.delta": 0.2,
        "character.frequency_hz": 7.0,
        "character.damping_ratio": 1.1,
        "character.gravity_m_s2": 9.0,
        "character.volume": False,
        "character.softness.legs": 0.5,
    }
    for name, value in changed.items():
        tuning.ask(name, value)
    assert tuning.apply() == changed
    assert {name: tuning.value(name) for name in changed} == changed
    assert owner.deformer is not None
    swing = SecondarySettings(0.2, 7.0, 1.1, (0.0, -9.0, 0.0))
    assert owner.deformer.settings == DeformSettings(False, swing, {"legs": 0.5})


def test_flesh_that_is_let_swing_again_swings_as_set_meanwhile(owner: Owner) -> None:
    tuning = Tuning(character_settings(owner))
    tuning.ask("character.secondary", False)
    tuning.apply()
    tuning.ask("character.delta", 0.3)
    tuning.apply()
    assert owner.deformer is not None
    assert owner.deformer.settings.secondary is None
    tuning.ask("character.secondary", True)
    tuning.apply()
    assert owner.deformer.settings.secondary == SecondarySettings(delta=0.3)


def test_another_resolution_is_bound_meanwhile(owner: Owner) -> None:
    tuning = Tuning(character_settings(owner))
    assert tuning.value("character.particles") == 300
    tuning.step("character.particles", 1)
    tuning.apply()
    assert owner.deformer is not None
    assert owner.deformer.lattice_settings.particles == 500
    assert tuning.value("character.particles") == 500
    assert owner.deformer.is_rebinding


def test_every_setting_says_what_it_does(owner: Owner) -> None:
    for setting in character_settings(owner):
        assert setting.text.endswith("."), setting.name
        assert setting.low < setting.high
        assert isinstance(setting.read(), bool) or setting.low <= setting.read() <= setting.high


def test_a_configured_character_is_bound_as_configured() -> None:
    look = CharacterConfig(resolution="low", particles=700, region_half_width=3)
    character = configured_cast(look, standard_skeleton()).character
    assert len(character.lattice.particles) == pytest.approx(700, rel=0.05)
    np.testing.assert_array_equal(character.regions.half_widths, 3)
