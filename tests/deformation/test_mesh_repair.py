"""Repairing meshes: faults put into a good one are found, told and mended."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deformation.mesh import Mesh, all_quads, is_closed, volume
from deformation.mesh_repair import in_metres, repaired, same_places
from devices.errors import SixpointError
from tests.deformation.bodies import box, joined

_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
_NO_TRIANGLES = np.empty((0, 3), np.int32)


def corners() -> np.ndarray:
    return np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)


def test_a_good_mesh_is_left_alone():
    mended = repaired(all_quads(corners(), _QUADS), "cube")
    assert mended.notes == ()
    assert np.array_equal(mended.mesh.quads, _QUADS)
    assert np.array_equal(mended.kept, np.arange(8))


@pytest.mark.parametrize("flipped", [[2], [0, 1, 2, 3, 4, 5], [1, 3, 4, 5]])
def test_flipped_faces_are_turned_outward(flipped: list[int]):
    quads = _QUADS.copy()
    quads[flipped] = quads[flipped, ::-1]
    mended = repaired(all_quads(corners(), quads), "cube")
    assert is_closed(mended.mesh)
    assert volume(mended.mesh) == pytest.approx(1)
    assert f"{len(flipped)} face" in mended.notes[0]
    assert "near (" in mended.notes[0]


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 4), st.integers(0, 2**31))
def test_any_faces_flipped_come_back(pieces: int, seed: int):
    random = np.random.default_rng(seed)
    good = joined(box((0, 0, 0), (1, 1, 1), pieces), box((2, 0, 0), (3, 1, 1), 2))
    good = all_quads(good.vertices, good.quads[random.permutation(len(good.quads))])
    flipped = good.quads.copy()
    chosen = random.random(len(flipped)) < 0.5
    flipped[chosen] = flipped[chosen][:, [0, 3, 2, 1]]
    np.testing.assert_array_equal(repaired(all_quads(good.vertices, flipped), "boxes").mesh.quads, good.quads)


def test_triangles_are_turned_too():
    triangles = all_quads(corners(), _QUADS).triangulated.copy()
    triangles[3] = triangles[3, ::-1]
    mended = repaired(Mesh(corners(), np.empty((0, 4), np.int32), triangles), "cube")
    assert is_closed(mended.mesh)
    assert volume(mended.mesh) == pytest.approx(1)


def test_doubled_degenerate_and_loose_are_dropped_and_told():
    quads = np.concatenate([_QUADS, _QUADS[2:3, ::-1], [[1, 1, 3, 3]]])
    vertices = np.concatenate([[[9.0, 9, 9]], corners()])
    mended = repaired(all_quads(vertices, quads + 1), "cube")
    assert is_closed(mended.mesh)
    assert mended.kept.tolist() == list(range(1, 9))
    notes = " ".join(mended.notes)
    assert "1 face there twice" in notes
    assert "1 face without area" in notes
    assert "1 vertex no face uses" in notes
    assert all(note.startswith("cube: ") for note in mended.notes)


def test_holes_and_pieces_are_told():
    mended = repaired(all_quads(corners(), _QUADS[:5]), "cube")
    assert mended.notes == ("cube: 4 edges of holes, the first near (0, 0.5, 1)",)
    two = all_quads(np.concatenate([corners(), corners() + 3]), np.concatenate([_QUADS, _QUADS[:, ::-1] + 8]))
    mended = repaired(two, "pair")
    assert volume(mended.mesh) == pytest.approx(2)
    assert "pair: 2 separate pieces" in mended.notes


def test_seams_of_texture_are_no_holes():
    separate = all_quads(corners()[_QUADS].reshape(-1, 3), np.arange(24).reshape(6, 4))
    assert repaired(separate, "cube").notes == ()
    assert len(np.unique(same_places(separate.vertices))) == 8


def test_a_mesh_of_nothing_is_refused():
    with pytest.raises(SixpointError, match="no face has an area"):
        repaired(Mesh(corners(), np.array([[0, 0, 1, 1]]), _NO_TRIANGLES), "flat")


@pytest.mark.parametrize(
    ("height", "unit", "word"),
    [(1.75, 1.0, None), (175, 0.01, "centimetres"), (17.5, 0.1, "decimetres"), (1750, 0.001, "millimetres")],
)
def test_units_are_guessed_from_a_persons_height(height: float, unit: float, word: str | None):
    guessed, note = in_metres(corners() * height, "x")
    assert guessed == unit
    assert (note is None) if word is None else (word in str(note))


def test_what_is_too_small_for_a_person_is_told():
    unit, note = in_metres(corners() * 0.15, "x")
    assert unit == 1.0
    assert "0.15 m tall" in str(note)
