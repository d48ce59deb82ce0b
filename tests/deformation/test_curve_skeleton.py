"""Centre lines: straight ones have no joints, bent ones one where they bend, and slices agree with curves."""

import numpy as np
import pytest

from deformation.curve_skeleton import downsampled, line_through, outward, sharpest_bend
from deformation.isocurves_geodesic import level_rings, longest_reference, mean_distance, peaks, slices, surface_graph
from deformation.mesh import Mesh
from tests.deformation.bodies import box, joined
from tests.deformation.test_isocurves import cylinder


def bent(angle: float, pieces: int = 30) -> np.ndarray:
    """(2 pieces + 1, 3) a line of two metres that turns in its middle."""
    first = np.linspace([0, 0, 0], [1, 0, 0], pieces + 1)
    second = np.linspace([1, 0, 0], [1 + np.cos(angle), np.sin(angle), 0], pieces + 1)
    return np.concatenate([first, second[1:]])


@pytest.mark.parametrize("degrees", [0, 10, 19, 21, 45, 90])
def test_a_joint_is_where_a_line_turns_by_twenty_degrees(degrees: float) -> None:
    points = bent(np.radians(degrees))
    line = line_through(points, np.ones(len(points)))
    assert downsampled(line).tolist() == ([0, 30, 60] if degrees >= 20 else [0, 60])


def test_a_corner_that_was_cut_is_found() -> None:
    points = bent(np.radians(60))
    smooth = points.copy()
    for _ in range(20):
        smooth[1:-1] = (smooth[:-2] + 2 * smooth[1:-1] + smooth[2:]) / 4
    line = line_through(smooth, np.ones(len(points)))
    arc, bend = sharpest_bend(line)
    assert bend == pytest.approx(np.radians(60), abs=0.15)
    assert np.linalg.norm(line.at(arc) - [1, 0, 0]) > 0.02
    found = line.at(arc) + outward(line, arc)
    np.testing.assert_allclose(found, [1, 0, 0], atol=0.02)
    slim = line_through(smooth, np.full(len(points), 0.1))
    assert np.linalg.norm(outward(slim, arc)) == pytest.approx(0.1 / (2 * np.pi))


def test_the_longest_loop_is_the_references() -> None:
    mesh = joined(box((0, 0, 0), (1, 1, 1), 5), box((2, 0, 0), (2.5, 1, 0.5), 4))
    graph = surface_graph(mesh)
    field = graph.vertices @ np.array([0.2, 1.0, -0.1])
    for level in np.linspace(field.min() + 0.05, field.max() - 0.05, 9):
        corners = field[graph.triangles]
        cut = np.flatnonzero((corners.min(axis=1) < level) & (corners.max(axis=1) >= level))
        centre, length = longest_reference(*slices(graph, field, cut, level))
        rings = level_rings(graph, field, np.array([level]))
        np.testing.assert_allclose(rings.centres[0], centre, atol=1e-12)
        assert rings.girths[0] == pytest.approx(length)


def test_where_a_hand_widens_and_narrows() -> None:
    arcs = np.arange(8.0)[:, None] * np.array([0.1, 0.0, 0.0])
    line = line_through(arcs, np.array([0.0, 0.05, 0.06, 0.25, 0.28, 0.2, 0.22, 0.3]))
    assert line.widens(0.6, 0.7) == pytest.approx(0.3)
    assert line.widest(0.3, 0.5) == pytest.approx(0.4)
    assert line.narrowest(0.4, 0.7) == pytest.approx(0.5)


def test_slices_of_a_cylinder_are_its_rings() -> None:
    mesh = cylinder(24, 21)
    graph = surface_graph(mesh)
    rings = level_rings(graph, graph.vertices[:, 0], np.array([0.22, 0.61]))
    np.testing.assert_allclose(rings.centres, [[0.22, 0, 0], [0.61, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(rings.girths, 2 * 24 * 0.1 * np.sin(np.pi / 24), rtol=1e-9)


def test_distances_are_hardly_longer_than_the_way() -> None:
    mesh = box((0, 0, 0), (1, 1, 1), 12)
    graph = surface_graph(mesh)
    start = int(np.argmin(np.linalg.norm(graph.vertices, axis=1)))
    face = graph.vertices[:, 2] < 1e-9
    straight = np.linalg.norm(graph.vertices[face], axis=1)
    along = graph.distances(start)[face]
    assert (along > straight - 1e-9).all()
    assert (along < 1.09 * straight + 1e-9).all()


def test_seams_are_welded_and_shells_bridged() -> None:
    near = joined(box((0, 0, 0), (1, 1, 1), 4), box((1.01, 0, 0), (2, 1, 1), 4), box((5, 0, 0), (6, 1, 1), 4))
    assert np.isfinite(surface_graph(near).distances(0)).all()
    split = box((0, 0, 0), (1, 1, 1), 4)
    loose = Mesh(split.vertices[split.quads.ravel()], np.arange(4 * len(split.quads)).reshape(-1, 4), split.triangles)
    assert len(surface_graph(loose).vertices) == len(split.vertices)


def test_peaks_are_the_ends_of_a_rod() -> None:
    graph = surface_graph(cylinder(8, 41))
    field = mean_distance(graph)
    found = peaks(graph, field, 0.3 * float(np.ptp(field)))
    assert sorted(round(float(x)) for x in graph.vertices[found.tops, 0]) == [0, 1]
    assert (found.saddles < 0).sum() == 1


def test_a_single_peak_has_the_whole_height() -> None:
    graph = surface_graph(cylinder(8, 21))
    found = peaks(graph, graph.vertices[:, 0].copy(), 0.1)
    assert found.heights.tolist() == pytest.approx([1.0])
