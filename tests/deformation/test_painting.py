from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deformation.character import Character, make_character, painting_of, rebound, repainted
from deformation.painting import Painting, painting_beside, read_painting, write_painting
from devices.errors import FileError
from tests.deformation.bodies import two_legs


@pytest.fixture(scope="module")
def character() -> Character:
    return make_character(*two_legs())


def laid_on(character: Character, path: Path) -> Character:
    return repainted(character, read_painting(path, character.skeleton, len(character.mesh.vertices)))


def weights(character: Character) -> np.ndarray:
    found = painting_of(character).weights
    assert found is not None
    return found


def softness(character: Character) -> np.ndarray:
    found = painting_of(character).softness
    assert found is not None
    return found


@pytest.mark.parametrize("ending", [".npz", ".toml"])
def test_a_saved_painting_laid_on_again_changes_next_to_nothing(
    character: Character, tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"p{ending}"
    write_painting(painting_of(character), character.skeleton, path)
    again = laid_on(character, path)
    np.testing.assert_allclose(weights(again), weights(character), atol=1e-6)
    assert np.abs(softness(again) - softness(character)).mean() < 0.1
    np.testing.assert_array_equal(again.regions.half_widths, character.regions.half_widths)
    same = again.parts.joints[again.parts.part_of] == character.parts.joints[character.parts.part_of]
    assert same.mean() > 0.85
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_what_is_painted_counts_and_what_is_bare_stays(character: Character, tmp_path: Path) -> None:
    high = character.mesh.vertices[:, 1] > 0.1
    np.savez(tmp_path / "p.npz", joints=["thigh_l"], weights=high[:, None].astype(float), softness=high.astype(float))
    other = laid_on(character, tmp_path / "p.npz")
    assert (weights(other)[high, 2] == 1).all()
    np.testing.assert_allclose(weights(other)[~high], weights(character)[~high], atol=1e-12)
    assert softness(other)[character.mesh.vertices[:, 1] > 0.2].min() > 0.9
    assert softness(other)[character.mesh.vertices[:, 1] < -0.1].max() < 0.1


def test_parts_and_half_widths_are_painted_on_the_vertices(character: Character, tmp_path: Path) -> None:
    high = character.mesh.vertices[:, 1] > 0.1
    thigh = character.skeleton.names.index("thigh_l")
    np.savez(tmp_path / "p.npz", joints=["thigh_l"], joint_part=np.where(high, 0, -1), half_width=np.where(high, 4, 0))
    other = laid_on(character, tmp_path / "p.npz")
    top = other.lattice.particles[:, 1] > 0.2
    low = other.lattice.particles[:, 1] < -0.1
    np.testing.assert_array_equal(other.parts.joints[other.parts.part_of[top]], thigh)
    before = character.parts.joints[character.parts.part_of]
    np.testing.assert_array_equal(other.parts.joints[other.parts.part_of][low], before[low])
    assert set(other.regions.half_widths[top]) == {4}
    assert set(other.regions.half_widths[low]) == {2}


def test_bone_parts_move_the_joint_parts_that_are_made_of_their_halves(character: Character) -> None:
    shin = character.skeleton.names.index("shin_l")
    left_knee_up = (character.mesh.vertices[:, 0] > 0) & (character.mesh.vertices[:, 1] > -0.3)
    left_thigh = left_knee_up & (character.mesh.vertices[:, 1] < 0)
    other = repainted(character, Painting(bone_parts=np.where(left_thigh, shin, -1).astype(np.int32)))
    grown = np.count_nonzero(other.parts.joints[other.parts.part_of] == shin)
    assert grown > 1.2 * np.count_nonzero(character.parts.joints[character.parts.part_of] == shin)
    np.testing.assert_array_equal(weights(other), weights(character))


def test_bones_are_adjusted_by_name(character: Character, tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(
        "[softness]\nthigh_l = 0.0\n[half_width]\nthigh_l = 5\n[parts]\nshin_r = 'thigh_r'\nthigh_r = 'hips'\n"
    )
    other = laid_on(character, tmp_path / "p.toml")
    thigh = character.skeleton.names.index("thigh_l")
    own = (other.binding.joints[:, 0] == thigh) & (other.binding.weights[:, 0] > 0.95)
    assert other.softness[own].max() < 0.05 < character.softness[own].max()
    assert set(other.regions.half_widths[own]) == {5}
    assert not set(other.parts.joints) & {character.skeleton.names.index(name) for name in ("shin_r", "thigh_r")}
    np.testing.assert_allclose(other.parts.volumes.sum(), character.parts.volumes.sum())


@pytest.mark.parametrize("section", ["bone_strength", "bone_width"])
def test_a_stronger_or_wider_bone_claims_more(character: Character, tmp_path: Path, section: str) -> None:
    shin = character.skeleton.names.index("shin_l")
    (tmp_path / "p.toml").write_text(f"[{section}]\nshin_l = 2\n")
    assert weights(laid_on(character, tmp_path / "p.toml"))[:, shin].sum() > 1.01 * weights(character)[:, shin].sum()


def test_a_character_bound_anew_keeps_its_paint(character: Character) -> None:
    painted = repainted(character, Painting(bone_softness=np.zeros(len(character.skeleton))))
    finer = rebound(painted, replace(character.settings, particles=900))
    assert len(finer.lattice.particles) != len(character.lattice.particles)
    assert finer.softness.max() == 0


def test_more_paint_goes_over_what_is_there() -> None:
    under = Painting(weights=np.eye(2), softness=np.array([0.1, 0.2]))
    over = Painting(weights=np.array([[0.0, 0.0], [1.0, 0.0]]))
    both = over.over(under)
    np.testing.assert_array_equal(both.weights, [[1, 0], [1, 0]])
    assert both.softness is under.softness


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ({"colour": [1]}, "holds none of"),
        ({"softness": [0.5, 0.5]}, "`softness`"),
        ({"weights": "bare"}, "`joints`"),
        ({"weights": "bare", "joints": ["tail"]}, "no joint 'tail'"),
        ({"softness": "nan"}, "`softness`"),
        ({"half_width": "nine"}, "`half_width`"),
        ({"joint_part": "nine", "joints": ["hips"]}, "`joint_part`"),
    ],
)
def test_a_painting_that_does_not_fit_is_refused(
    character: Character, tmp_path: Path, layers: dict, message: str
) -> None:
    count = len(character.mesh.vertices)
    fill = {"bare": np.zeros((count, 1)), "nan": np.full(count, np.nan), "nine": np.full(count, 9)}
    np.savez(tmp_path / "p.npz", **{k: fill[v] if isinstance(v, str) else np.array(v) for k, v in layers.items()})  # type: ignore[arg-type]
    with pytest.raises(FileError, match=message):
        laid_on(character, tmp_path / "p.npz")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[softness]\ntail = 1", "no joint 'tail'"),
        ("[softness]\nhips = 2", r"softness.hips: a number from 0 to 1, not 2"),
        ("[colour]\nhips = 1", "unknown section 'colour'"),
        ("[parts]\nhips = 'thigh_l'\nthigh_l = 'hips'", "in a circle"),
        ("[softness", "not TOML"),
    ],
)
def test_a_text_that_does_not_fit_is_refused(character: Character, tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "p.toml").write_text(text)
    with pytest.raises(FileError, match=message):
        laid_on(character, tmp_path / "p.toml")


def test_a_missing_or_broken_file_is_named(character: Character, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        laid_on(character, tmp_path / "none.npz")
    (tmp_path / "p.npz").write_bytes(b"PK\x03\x04 not really")
    with pytest.raises(FileError, match="not a NumPy archive"):
        laid_on(character, tmp_path / "p.npz")
    with pytest.raises(FileError, match="ends in"):
        write_painting(Painting(), character.skeleton, tmp_path / "p.png")


def test_a_painting_beside_a_character_is_found(tmp_path: Path) -> None:
    assert painting_beside(tmp_path / "who.glb") is None
    (tmp_path / "who.painting.toml").write_text("")
    assert painting_beside(tmp_path / "who.glb") == tmp_path / "who.painting.toml"
