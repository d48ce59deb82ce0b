import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deformation.character import Character, LatticeSettings, make_character
from deformation.deformer import Deformer, DeformSettings
from deformation.live_deformer import FADE_S, LiveDeformer
from deformation.secondary_motion import SecondarySettings
from devices.errors import SixpointError
from tests.deformation.bodies import two_legs

FRAME_S = 1 / 60


@pytest.fixture(scope="module")
def character() -> Character:
    return make_character(*two_legs(), settings=LatticeSettings(particles=300))


def kneeling(character: Character, bend: float) -> np.ndarray:
    transforms = character.bind.copy()
    turn = Rotation.from_rotvec([bend, 0, 0]).as_matrix()
    at = character.bind[3, :3, 3]
    for joint in (3, 4):
        transforms[joint, :3, :3] = turn
        transforms[joint, :3, 3] = turn @ (character.bind[joint, :3, 3] - at) + at
    return transforms


def wait(deformer: LiveDeformer) -> None:
    end = time.monotonic() + 60
    while deformer._worker is not None:
        assert time.monotonic() < end
        time.sleep(0.02)


def test_without_a_wish_it_is_a_deformer(character: Character) -> None:
    live, plain = LiveDeformer(character), Deformer(character)
    for bend in np.linspace(0, 1.5, 8):
        pose = kneeling(character, bend)
        np.testing.assert_array_equal(live.deform(pose).vertices, plain.deform(pose).vertices)
    assert not live.is_rebinding


def test_a_finer_lattice_takes_over_without_a_jump(character: Character) -> None:
    live, pose = LiveDeformer(character, DeformSettings(secondary=None)), kneeling(character, 1.8)
    coarse = live.deform(pose).vertices.copy()
    live.rebind(replace(character.settings, particles=900))
    assert live.is_rebinding
    assert live.lattice_settings.particles == 900
    wait(live)
    finer = Deformer(make_character(*two_legs(), settings=LatticeSettings(particles=900)), live.settings).deform(pose)
    shown = [live.deform(pose).vertices.copy() for _ in range(round(FADE_S / FRAME_S) + 3)]
    np.testing.assert_array_equal(shown[0], coarse)
    np.testing.assert_allclose(shown[-1], finer.vertices, atol=1e-12)
    whole = np.abs(finer.vertices - coarse).max()
    steps = np.abs(np.diff([coarse, *shown], axis=0)).max(axis=(1, 2))
    assert whole > 1e-4
    assert steps.max() < 0.15 * whole
    assert len(live.character.lattice.particles) == len(finer.particles)
    assert live.character.mesh is character.mesh
    assert not live.character.binding.weights.flags.writeable
    assert not live.is_rebinding


def test_settings_changed_meanwhile_are_those_of_the_new_lattice(character: Character) -> None:
    live = LiveDeformer(character)
    live.rebind(replace(character.settings, particles=500))
    live.settings = DeformSettings(volume=False, secondary=SecondarySettings(delta=0.2))
    wait(live)
    live.deform(character.bind)
    assert live.settings == DeformSettings(volume=False, secondary=SecondarySettings(delta=0.2))
    live.settings = DeformSettings(secondary=None)
    assert live._before is not None
    assert live._before.settings == live._now.settings
    live.reset()
    assert live._before is None, "what begins anew does not go over from anything"


def test_of_two_wishes_the_last_counts(character: Character) -> None:
    live = LiveDeformer(character)
    for count in (400, 600):
        live.rebind(replace(character.settings, particles=count))
    wait(live)
    live.deform(character.bind)
    assert live.character.settings.particles == 600


def test_a_wish_that_cannot_be_leaves_all_as_it_was(character: Character) -> None:
    live = LiveDeformer(character)
    live.rebind(replace(character.settings, particles=3))
    wait(live)
    assert isinstance(live.failure, SixpointError)
    assert "at least 50" in str(live.failure)
    assert live.deform(character.bind).character is character
    assert not live.is_rebinding
