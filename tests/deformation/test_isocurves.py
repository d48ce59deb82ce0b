"""Curves of quad meshes: each edge on one curve, tubes where rings lie side by side, any numbering of the faces."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from deformation.curve_skeleton import ring_means_reference, tube_rings
from deformation.isocurves import iso_curves, tubes
from deformation.mannequin import mannequin
from deformation.mesh import Mesh, all_quads, edges
from reconstruction.standard_body import standard_skeleton
from tests.deformation.bodies import box


def cylinder(around: int, along: int, bend: float = 0.0) -> Mesh:
    """An open tube of radius 0.1 and length 1 along X, bent upward by `bend` radians past its middle."""
    turn = 2 * np.pi * np.arange(around) / around
    rings = []
    for x in np.linspace(0, 1, along):
        centre = np.array([x, 0, 0]) if x <= 0.5 else np.array([0.5, 0, 0]) + (x - 0.5) * _towards(bend)
        side = np.array([0, 1.0, 0]) if x <= 0.5 else np.array([-np.sin(bend), np.cos(bend), 0])
        rings.append(centre + 0.1 * (np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * [0, 0, 1.0]))
    i, j = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    quads = np.stack([a, b, b + around, a + around], axis=-1).reshape(-1, 4)
    return all_quads(np.concatenate(rings), quads.astype(np.int32))


def _towards(bend: float) -> np.ndarray:
    return np.array([np.cos(bend), np.sin(bend), 0])


def torus(around: int, along: int) -> Mesh:
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    u, v = 2 * np.pi * i / along, 2 * np.pi * j / around
    vertices = np.stack([(1 + 0.3 * np.cos(v)) * np.cos(u), 0.3 * np.sin(v), (1 + 0.3 * np.cos(v)) * np.sin(u)], -1)

    def at(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return (p % along) * around + q % around

    quads = np.stack([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)], -1).reshape(-1, 4)
    return all_quads(vertices.reshape(-1, 3), quads.astype(np.int32))


def steps(mesh: Mesh) -> list[tuple[int, int]]:
    """Every edge that the curves walk, the smaller vertex first."""
    curves, walked = iso_curves(mesh), []
    for number in range(len(curves)):
        line = curves.curve(number).tolist()
        ends = [*line, line[0]] if curves.closed[number] else line
        walked += [(min(a, b), max(a, b)) for a, b in pairwise(ends)]
    return walked


def test_every_edge_is_walked_once() -> None:
    for mesh in (cylinder(8, 9), torus(5, 7), box((0, 0, 0), (1, 1, 1)), mannequin(standard_skeleton(), "low")[0]):
        assert sorted(steps(mesh)) == [tuple(edge) for edge in edges(mesh).tolist()]


@settings(max_examples=20, deadline=None)
@given(st.randoms(use_true_random=False), st.integers(3, 8), st.integers(4, 9))
def test_numbering_does_not_matter(random, around: int, along: int) -> None:
    mesh = cylinder(around, along)
    order = list(range(len(mesh.quads)))
    random.shuffle(order)
    turned = np.stack([np.roll(mesh.quads[q], random.randrange(4)) for q in order])
    one, other = iso_curves(mesh), iso_curves(all_quads(mesh.vertices, turned))
    assert len(one) == len(other)
    assert one.closed.sum() == other.closed.sum()


def test_a_cylinder_is_one_tube_of_rings_in_order() -> None:
    mesh = cylinder(8, 9)
    curves = iso_curves(mesh)
    found = tubes(mesh, curves)
    assert len(found) == 1
    # The rims are no curves to walk round: their vertices have two quads only.
    assert len(found.tube(0)) == 7
    middles = tube_rings(mesh.vertices, curves, found).centres[:, 0]
    assert (np.diff(middles) > 0).all() or (np.diff(middles) < 0).all()
    assert sum(~curves.closed) == 8 + 2 * 8


def test_a_torus_closes_both_ways() -> None:
    mesh = torus(6, 9)
    curves = iso_curves(mesh)
    assert curves.closed.all()
    assert sorted(len(tubes(mesh, curves).tube(n)) for n in range(2)) == [6, 9]


def test_curves_end_at_triangles_and_extraordinary_vertices() -> None:
    cube = box((0, 0, 0), (1, 1, 1), 4)
    curves = iso_curves(cube)
    corners = {n for n, p in enumerate(cube.vertices) if set(p.tolist()) <= {0.0, 1.0}}
    ends = {int(v) for n in range(len(curves)) if not curves.closed[n] for v in curves.curve(n)[[0, -1]]}
    assert ends == corners
    assert curves.closed.sum() == 9
    cut = Mesh(cube.vertices, cube.quads[1:], cube.quads[:1, [0, 1, 2]])
    assert iso_curves(cut).closed.sum() < 9


def test_ring_means_are_those_of_plain_numpy() -> None:
    mesh, _ = mannequin(standard_skeleton(), "low")
    curves = iso_curves(mesh)
    rings = tube_rings(mesh.vertices, curves, tubes(mesh, curves))
    for curve, centre, girth in zip(rings.curves, rings.centres, rings.girths, strict=True):
        plain = ring_means_reference(mesh.vertices, curves.curve(int(curve)))
        np.testing.assert_allclose(centre, plain[0], atol=1e-12)
        np.testing.assert_allclose(girth, plain[1], atol=1e-12)


def test_a_person_has_tubes_for_limbs_and_trunk() -> None:
    mesh, _ = mannequin(standard_skeleton(), "low")
    curves = iso_curves(mesh)
    found = tubes(mesh, curves)
    rings = sorted(len(found.tube(n)) for n in range(len(found)))
    assert rings[-4] > 15


def test_some_of_the_curves_are_themselves() -> None:
    mesh = cylinder(8, 9)
    curves = iso_curves(mesh)
    rings = tubes(mesh, curves).tube(0)
    some = curves.only(rings)
    assert some.closed.all()
    for new, old in enumerate(rings):
        assert np.array_equal(some.curve(new), curves.curve(int(old)))
        assert np.array_equal(np.flatnonzero(some.edges == new), np.flatnonzero(curves.edges == old))
