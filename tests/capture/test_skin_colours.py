import numpy as np
import pytest

from capture.characters import Cast
from capture.skin_colours import SkinColours
from capture.stage import Stage
from capture.viewing import PAINTS, Layers
from deformation.character import Character, LatticeSettings, mannequin_character
from deformation.deformer import Deformer
from reconstruction.standard_body import standard_skeleton

OWN = (0.5, 0.4, 0.3)


@pytest.fixture(scope="module")
def character() -> Character:
    return mannequin_character(standard_skeleton(), "low", settings=LatticeSettings(particles=700))


@pytest.mark.parametrize("paint", PAINTS[1:])
def test_every_paint_colours_every_vertex_in_several_colours_and_says_so(character: Character, paint: str) -> None:
    colours = SkinColours(character, OWN)
    painted = np.asarray(colours.painted(paint, bone=3))
    assert painted.shape == character.mesh.vertices.shape
    assert ((painted >= 0) & (painted <= 1)).all()
    assert len(np.unique(painted.round(3), axis=0)) >= (1 if paint == "regions" else 5)
    assert "painted by" in colours.legend(paint, 3)


def test_skin_is_what_the_character_wears(character: Character) -> None:
    assert SkinColours(character, OWN).painted("skin") == OWN
    assert SkinColours(character, OWN).legend("skin") == ""


def test_the_weight_of_the_chosen_bone_is_hot_where_it_is_strong(character: Character) -> None:
    forearm = character.skeleton.names.index("LeftForeArm")
    colours = SkinColours(character, OWN)
    red = np.asarray(colours.painted("weights", forearm))[:, 0]
    strong = (character.vertex_joints[:, 0] == forearm) & (character.vertex_weights[:, 0] > 0.9)
    assert red[strong].min() > red[~(character.vertex_joints == forearm).any(axis=1)].max()
    assert "LeftForeArm" in colours.legend("weights", forearm)
    assert colours.painted("weights", forearm + len(character.skeleton)) is colours.painted("weights", forearm)


def test_the_stage_paints_the_skin_and_follows_a_character_bound_anew(character: Character) -> None:
    stage = Stage(character.skeleton, Cast(character, colours=OWN))
    layers = Layers(paint="bones", lattice=True)
    for body in (character, mannequin_character(character.skeleton, "low", settings=LatticeSettings(particles=1500))):
        scene = stage.scene(0.0, None, body.bind, Deformer(body).deform(body.bind), layers)
        np.testing.assert_array_equal(scene.surfaces[0].colours, SkinColours(body, OWN).painted("bones"))
        assert scene.lines[0].segments.max() == len(body.lattice.particles) - 1
        assert "painted by the strongest bone" in scene.status
