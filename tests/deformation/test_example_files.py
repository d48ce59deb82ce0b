"""Examples files: what they show is what the character then looks like; wrong ones are named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deformation.character import Character, LatticeSettings, make_character
from deformation.character_files import Placement
from deformation.deformer import Deformer, DeformSettings
from deformation.example_files import examples_beside, found_turn, posed, with_examples
from deformation.inbetween_files import write_shapes
from deformation.mesh_files import read_mesh
from devices.errors import FileError
from tests.deformation.bodies import chain
from tests.deformation.test_isocurves import cylinder

TURN = np.radians([0.0, 0.0, 70.0])
HEAD = 'format = "sixpoint-examples 1"\n\n[[example]]\nmesh = "bent/0000.obj"\njoint = "joint1"\n'


@pytest.fixture(scope="module")
def character() -> Character:
    mesh = cylinder(12, 24)
    long = float(np.ptp(mesh.vertices[:, 0]))
    skeleton, bind = chain((0, 0, 0), (long / 2, 0, 0), (long, 0, 0))
    return make_character(mesh, skeleton, bind, settings=LatticeSettings(particles=300))


def at(character: Character, turn: np.ndarray) -> np.ndarray:
    """(V, 3) of the character at rest with its middle joint turned."""
    deformer = Deformer(character, DeformSettings(secondary=None))
    return deformer.deform(posed(character, {1: turn})).vertices.copy()


@pytest.fixture
def folder(character: Character, tmp_path: Path) -> Path:
    """An example: the character bent, with a bump."""
    bent = at(character, TURN)
    bump = 0.02 * np.exp(-(((character.mesh.vertices - character.mesh.vertices[140]) / 0.1) ** 2).sum(axis=1))
    write_shapes(character.mesh, [bent + bump[:, None] * [0.0, 0.0, 1.0]], tmp_path / "bent")
    (tmp_path / "hero.examples.toml").write_text(HEAD + "turn_deg = [0, 0, 70]\n")
    return tmp_path


def test_the_example_is_met(character: Character, folder: Path) -> None:
    file = examples_beside(folder / "hero.obj")
    assert file is not None
    wearing = with_examples(character, file)
    shown = at(wearing, TURN)
    np.testing.assert_allclose(shown, read_mesh(folder / "bent" / "0000.obj").vertices, atol=2e-5)
    plain, half = at(character, TURN / 2), at(wearing, TURN / 2)
    assert 0.008 < np.linalg.norm(half - plain, axis=1).max() < 0.012
    np.testing.assert_allclose(at(wearing, 0 * TURN), at(character, 0 * TURN), atol=1e-12)


def test_how_far_it_is_bent_is_found_from_the_mesh(character: Character, folder: Path) -> None:
    turn = found_turn(character, at(character, TURN), 1)
    assert turn is not None
    np.testing.assert_allclose(turn, TURN, atol=0.03)
    assert found_turn(character, character.mesh.vertices, 0) is None
    (folder / "hero.examples.toml").write_text(HEAD)
    wearing = with_examples(character, folder / "hero.examples.toml")
    np.testing.assert_allclose(wearing.examples[0].turn, TURN, atol=0.03)


def test_vertices_are_placed_as_the_characters_own(character: Character, folder: Path) -> None:
    placement = Placement(
        len(character.mesh.vertices),
        np.diag([-1.0, 1.0, -1.0]) * 2.0,
        np.arange(len(character.mesh.vertices)),
        np.array([0.1, 0.2, 0.3]),
    )
    bent = (folder / "bent" / "0000.obj").read_text()
    vertices = np.array([line.split()[1:] for line in bent.splitlines() if line.startswith("v ")], float)
    back = (vertices - placement.shift) @ np.linalg.inv(placement.turn)
    write_shapes(character.mesh, [back], folder / "bent")
    np.testing.assert_allclose(placement.placed(back), vertices, atol=1e-9)
    (folder / "hero.examples.toml").write_text(HEAD + "turn_deg = [0, 0, -70]\npose = { joint0 = [0, 0, 0] }\n")
    wearing = with_examples(character, folder / "hero.examples.toml", placement)
    np.testing.assert_allclose(wearing.examples[0].turn, TURN, atol=1e-12)
    np.testing.assert_allclose(at(wearing, TURN), vertices, atol=2e-5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "format"),
        ("nonsense", "not TOML"),
        ('format = "sixpoint-examples 1"\n', r"no \[\[example\]\]"),
        (HEAD.replace("joint1", "joint7"), "no joint 'joint7'"),
        (HEAD + "angle = 3\n", "no key 'angle'"),
        (HEAD + "turn_deg = 3\n", "three numbers"),
        (HEAD + "turn_deg = [300, 0, 0]\n", "180"),
        (HEAD + "turn_deg = [0, 0, 0.1]\n", "not bent"),
        (HEAD + "pose = 3\n", "pose is not a table"),
        (HEAD.replace("bent/0000.obj", "none.obj"), r"none\.obj"),
        (HEAD + "turn_deg = [0, 0, 70]\n" + HEAD[HEAD.index("[[") :] + "turn_deg = [0, 0, 70]\n", "example 2"),
    ],
)
def test_wrong_files_are_told(character: Character, folder: Path, text: str, words: str) -> None:
    (folder / "hero.examples.toml").write_text(text)
    with pytest.raises(FileError, match=words):
        with_examples(character, folder / "hero.examples.toml")


def test_another_mesh_is_refused(character: Character, folder: Path) -> None:
    small = cylinder(6, 8)
    write_shapes(small, [small.vertices], folder / "bent")
    with pytest.raises(FileError, match="48 vertices where"):
        with_examples(character, folder / "hero.examples.toml")
    assert examples_beside(folder / "other.obj") is None


def test_joints_turn_about_where_they_stand(character: Character) -> None:
    joints = posed(character, {0: TURN, 1: TURN})
    assert np.allclose(joints[0, :3, 3], character.bind[0, :3, 3])
    both = Rotation.from_rotvec(2 * TURN).as_matrix()
    np.testing.assert_allclose(joints[2, :3, :3], both, atol=1e-12)
    straight = replace(character, examples=())
    np.testing.assert_allclose(posed(straight, {}), character.bind)
