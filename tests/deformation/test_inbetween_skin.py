"""The whole skin takes part: every vertex of a body on a curve, and a smooth field between and beyond them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deformation.inbetween import inbetween
from deformation.inbetween_skin import WholeSkin, whole_skin
from deformation.mannequin import mannequin
from deformation.mesh import Mesh, edges
from reconstruction.standard_body import standard_skeleton
from tests.deformation.bodies import box
from tests.deformation.test_isocurves import cylinder


@pytest.fixture(scope="module")
def body() -> Mesh:
    return mannequin(standard_skeleton(), "low")[0]


@pytest.fixture(scope="module")
def skin(body: Mesh) -> WholeSkin:
    return whole_skin(body)


def test_every_vertex_of_a_body_is_on_a_curve(body: Mesh, skin: WholeSkin) -> None:
    assert len(np.unique(skin.curves.vertices)) > 0.98 * len(body.vertices)
    on_rings = skin.curves.vertices[: skin.curves.starts[skin.rings]]
    assert len(np.unique(on_rings)) == len(on_rings)
    assert skin.curves.closed[: skin.rings].all()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**31))
def test_the_field_is_the_rings_own_and_never_beyond_the_curves(body: Mesh, skin: WholeSkin, seed: int) -> None:
    lag = np.random.default_rng(seed).normal(size=(len(skin.curves.vertices), 3))
    field = skin.spread(lag)
    end = skin.curves.starts[skin.rings]
    np.testing.assert_allclose(field[skin.curves.vertices[:end]], lag[:end], atol=1e-9)
    assert (field <= np.maximum(lag.max(axis=0), 0) + 1e-9).all()
    assert (field >= np.minimum(lag.min(axis=0), 0) - 1e-9).all()
    assert field.shape == body.vertices.shape


def test_the_field_has_no_seam(body: Mesh, skin: WholeSkin) -> None:
    places = body.vertices[skin.curves.vertices]
    field = skin.spread(np.sin(4 * places))
    ends = edges(body)
    jump = np.linalg.norm(field[ends[:, 0]] - field[ends[:, 1]], axis=1)
    length = np.linalg.norm(body.vertices[ends[:, 0]] - body.vertices[ends[:, 1]], axis=1)
    # The slope of the given field is 4 at most in each direction.
    assert np.quantile(jump / length, 0.999) < 8


def test_triangles_that_make_no_quads_follow_their_way() -> None:
    mesh = box((0, 0, 0), (1, 1, 1), 1)
    corners = np.concatenate([mesh.vertices, [[0.5, 0.5, 1.5]]])
    triangles = np.array([[0, 1, 8], [1, 2, 8], [2, 3, 8]], np.int32)
    bare = Mesh(corners, np.empty((0, 4), np.int32), triangles)
    higher = corners + np.array([0, 0.5, 0])
    shapes = list(inbetween(bare, [corners, higher], 3))
    np.testing.assert_array_equal(shapes[-1], higher)
    assert len(shapes) == 5


def test_a_tube_without_ends_is_rings_alone() -> None:
    skin = whole_skin(cylinder(12, 15))
    assert skin.rings == 13
    field = skin.spread(np.ones((len(skin.curves.vertices), 3)))
    # The open ends have no ring of their own, and go along with their neighbours.
    assert field[:12].min() > 0.5
