"""The two-plane ray test: it knows around from along on round limbs, and its curves are the rings of tubes."""

import numpy as np
import pytest

from deformation.isocurves import iso_curves, tubes
from deformation.isocurves_rays import LINES, RayTest, clearest_seeds, ray_curves
from tests.deformation.bodies import box
from tests.deformation.test_isocurves import cylinder, torus

pytest.importorskip("open3d", reason="Open3D does not load here", exc_type=ImportError)


def test_around_a_cylinder_the_plane_is_across_it() -> None:
    mesh = cylinder(12, 25)
    inner = np.arange(12 * 8, 12 * 16, dtype=np.int32)
    found = RayTest(mesh).directions(inner)
    np.testing.assert_allclose(np.abs(found.around[:, 0]), 1, atol=1e-3)
    # The ray along a quad's normal leaves the vertex of a 12-gon at half a corner from its centre.
    radius = np.linalg.norm(mesh.vertices[inner, 1:], axis=1).mean()
    assert found.spreads.min(axis=1).max() <= 1.01 * radius * np.sin(np.pi / 12)
    np.testing.assert_allclose(found.radii[np.isfinite(found.radii)].min(), radius, rtol=0.05)


def test_spreads_are_those_of_plain_geometry() -> None:
    mesh = box((-1, -2, -3), (1, 2, 3), 6)
    seed = int(np.argmin(np.linalg.norm(mesh.vertices - [1.0, 0, 0], axis=1)))
    found = RayTest(mesh).directions(np.array([seed], np.int32))
    # Through the middle of a box the planes across x and y, and across x and z, cut rectangles of 2 x 4 and 2 x 6.
    turn = np.pi * np.arange(2 * LINES) / LINES
    expected = []
    for half in (2.0, 3.0):
        away = np.minimum(1 / np.maximum(np.abs(np.cos(turn)), 1e-12), half / np.maximum(np.abs(np.sin(turn)), 1e-12))
        expected.append(float(np.ptp(away)))
    np.testing.assert_allclose(np.sort(found.spreads[0]), np.sort(expected), atol=1e-3)
    np.testing.assert_allclose(np.abs(found.around[0]), [0, 0, 1], atol=1e-4)


@pytest.mark.parametrize("bend", [0.0, 80.0])
def test_the_rings_of_a_tube_are_found_from_one_seed(bend: float) -> None:
    mesh = cylinder(12, 30, np.radians(bend))
    walked = iso_curves(mesh)
    rings = {frozenset(walked.curve(n).tolist()) for n in range(len(walked)) if walked.closed[n]}
    found = ray_curves(mesh, np.array([12 * 15], np.int32))
    closed = {frozenset(found.curve(n).tolist()) for n in range(len(found)) if found.closed[n]}
    assert len(closed & rings) > 0.8 * len(rings)
    if not bend:
        # The open ends are rings too, which the walk along edges takes for walls.
        assert closed - rings == {frozenset(range(12)), frozenset(range(12 * 29, 12 * 30))}
    assert len(tubes(mesh, found)) == (2 if bend else 1)


def test_each_vertex_is_on_one_curve_at_most() -> None:
    mesh = torus(8, 20)
    seeds = clearest_seeds(RayTest(mesh), [np.arange(len(mesh.vertices))])
    found = ray_curves(mesh, seeds)
    assert len(np.unique(found.vertices)) == len(found.vertices) == len(mesh.vertices)
    assert set(np.diff(found.starts)[found.closed]) == {8}


def test_the_sides_of_quads_belong_to_the_curves_on_them() -> None:
    mesh = cylinder(10, 12)
    found = ray_curves(mesh, np.array([10 * 6], np.int32))
    sides = np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    for curve in range(len(found)):
        ring = found.curve(curve)
        pairs = {frozenset(p) for p in zip(ring.tolist(), np.roll(ring, -1).tolist(), strict=True)}
        if not found.closed[curve]:
            pairs.discard(frozenset((int(ring[-1]), int(ring[0]))))
        assert {frozenset(side) for side in sides[found.edges == curve].tolist()} == pairs


def test_an_open_sheet_gives_no_plane() -> None:
    mesh = cylinder(4, 3)
    flat = mesh.with_vertices(mesh.vertices * [1, 1, 0])
    assert not clearest_seeds(RayTest(flat), [np.arange(len(flat.vertices))]).size
