"""Example shapes on their way from files to what is shown: beside the character, given, through `sixpoint deform`."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from capture.characters import cast
from capture.cli import main
from capture.commands.rig import rig
from deformation.character import Character
from deformation.deformer import Deformer, DeformSettings
from deformation.example_files import posed
from deformation.inbetween_files import write_shapes
from deformation.mannequin import mannequin
from reconstruction.motion import Motion
from reconstruction.motion_files import write_bvh
from reconstruction.standard_body import standard_skeleton

TURN_DEG = [0.0, -80.0, 0.0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """hero.obj with its rig, and an example of its left elbow in centimetres that swells by 2."""
    place = tmp_path_factory.mktemp("hero")
    mesh, _ = mannequin(standard_skeleton(), "low")
    write_shapes(mesh, [100 * mesh.vertices], place / "rest")
    shutil.copy(place / "rest" / "0000.obj", place / "hero.obj")
    rig([place / "hero.obj"], place / "hero.rig.json", picture=False)
    hero = cast(str(place / "hero.obj"), standard_skeleton()).character
    middle = hero.bind[hero.skeleton.humanoid["left_upper_arm"], :3, 3]
    near = np.exp(-((np.linalg.norm(hero.mesh.vertices - middle, axis=1) / 0.08) ** 2))
    swollen = at_elbow(hero, 1.0) + 0.02 * (near / near.max())[:, None] * [0, 0, 1]
    write_shapes(mesh, [100 * swollen], place / "bent")
    (place / "given.toml").write_text(
        'format = "sixpoint-examples 1"\n[[example]]\nmesh = "bent/0000.obj"\njoint = "left_lower_arm"\n'
        f"turn_deg = {TURN_DEG}\n"
    )
    return place


def at_elbow(character: Character, share: float) -> np.ndarray:
    """(V, 3) at rest with the left elbow so far bent."""
    elbow = character.skeleton.humanoid["left_lower_arm"]
    deformer = Deformer(character, DeformSettings(secondary=None))
    return deformer.deform(posed(character, {elbow: share * np.radians(TURN_DEG)})).vertices.copy()


def test_a_file_beside_the_character_is_worn(folder: Path) -> None:
    plain = cast(str(folder / "hero.obj"), standard_skeleton()).character
    given = cast(str(folder / "hero.obj"), standard_skeleton(), examples=folder / "given.toml").character
    shutil.copy(folder / "given.toml", folder / "hero.examples.toml")
    try:
        beside = cast(str(folder / "hero.obj"), standard_skeleton()).character
    finally:
        (folder / "hero.examples.toml").unlink()
    assert not plain.examples
    for worn in (given, beside):
        swollen = at_elbow(worn, 1.0) - at_elbow(plain, 1.0)
        assert np.linalg.norm(swollen, axis=1).max() == pytest.approx(0.02, abs=2e-3)
        np.testing.assert_allclose(at_elbow(worn, 0.0), at_elbow(plain, 0.0), atol=1e-9)


def test_deform_writes_what_the_examples_make(folder: Path, tmp_path: Path) -> None:
    skeleton = standard_skeleton()
    turns = np.tile([0.0, 0, 0, 1.0], (4, len(skeleton), 1))
    turns[:, skeleton.humanoid["left_lower_arm"]] = Rotation.from_euler("y", -80, degrees=True).as_quat()
    write_bvh(Motion(skeleton, np.tile([0, 0.95, 0], (4, 1)), turns, 30.0), tmp_path / "bent.bvh")
    options = ["--out", str(tmp_path / "plain.npz"), "--particles", "300", "--delta", "0"]
    words = ["deform", str(folder / "hero.obj"), str(tmp_path / "bent.bvh")]
    assert main([*words, *options]) == 0
    options[1] = str(tmp_path / "worn.npz")
    assert main([*words, *options, "--examples", str(folder / "given.toml")]) == 0
    with np.load(tmp_path / "plain.npz") as plain, np.load(tmp_path / "worn.npz") as worn:
        swollen = np.linalg.norm(worn["vertices"] - plain["vertices"], axis=2).max()
    assert 0.01 < swollen < 0.025
    assert main([*words, *options, "--examples", str(tmp_path / "none.toml")]) == 2
