from pathlib import Path

import numpy as np
import pytest

from deformation.character import Character, make_character
from deformation.painting import dense_weights, painted, save_painting, vertex_softness
from devices.errors import FileError
from tests.deformation.bodies import two_legs


@pytest.fixture(scope="module")
def character() -> Character:
    return make_character(*two_legs())


def test_a_saved_painting_laid_on_again_changes_next_to_nothing(character: Character, tmp_path: Path) -> None:
    save_painting(character, tmp_path / "p.npz")
    again = painted(character, tmp_path / "p.npz")
    np.testing.assert_allclose(dense_weights(again), dense_weights(character), atol=1e-6)
    assert np.abs(vertex_softness(again) - vertex_softness(character)).mean() < 0.1
    assert [p.name for p in tmp_path.iterdir()] == ["p.npz"]


def test_what_is_painted_counts_and_what_is_bare_stays(character: Character, tmp_path: Path) -> None:
    high = character.mesh.vertices[:, 1] > 0.1
    np.savez(tmp_path / "p.npz", joints=["thigh_l"], weights=high[:, None].astype(float), softness=high.astype(float))
    other = painted(character, tmp_path / "p.npz")
    assert (dense_weights(other)[high, 2] == 1).all()
    np.testing.assert_allclose(dense_weights(other)[~high], dense_weights(character)[~high], atol=1e-12)
    assert vertex_softness(other)[character.mesh.vertices[:, 1] > 0.2].min() > 0.9
    assert vertex_softness(other)[character.mesh.vertices[:, 1] < -0.1].max() < 0.1


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ({"colour": [1]}, "neither"),
        ({"softness": [0.5, 0.5]}, "`softness`"),
        ({"weights": "bare"}, "`joints`"),
        ({"weights": "bare", "joints": ["tail"]}, "no joint 'tail'"),
        ({"softness": "nan"}, "`softness`"),
    ],
)
def test_a_painting_that_does_not_fit_is_refused(
    character: Character, tmp_path: Path, layers: dict, message: str
) -> None:
    count = len(character.mesh.vertices)
    fill = {"bare": np.zeros((count, 1)), "nan": np.full(count, np.nan)}
    np.savez(tmp_path / "p.npz", **{k: fill[v] if isinstance(v, str) else np.array(v) for k, v in layers.items()})
    with pytest.raises(FileError, match=message):
        painted(character, tmp_path / "p.npz")


def test_a_missing_or_broken_file_is_named(character: Character, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        painted(character, tmp_path / "none.npz")
    (tmp_path / "p.npz").write_bytes(b"PK\x03\x04 not really")
    with pytest.raises(FileError, match="not a NumPy archive"):
        painted(character, tmp_path / "p.npz")
