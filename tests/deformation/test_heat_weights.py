import numpy as np
import pytest

from deformation.heat_weights import (
    bone_distances,
    conductance,
    heat_weights,
    joints_apart,
    separate_branches,
    skeleton_bones,
    strongest,
    subtree,
)
from deformation.lattice import build_lattices
from devices.errors import SixpointError
from tests.deformation.bodies import at, box, chain, joined, two_legs


def test_weights_sum_to_one_and_end_at_the_own_bone() -> None:
    skeleton, bind = chain((0, 0, 0), (0, 0.5, 0), (0, 1, 0))
    lattice, _, _ = build_lattices(box((-0.1, -0.05, -0.1), (0.1, 1.05, 0.1)), 0.05)
    weights = heat_weights(lattice, skeleton_bones(skeleton, bind[:, :3, 3], 0.04), skeleton)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
    height = lattice.particles[:, 1]
    assert (weights[height < 0.35, 0] > 0.9).all()
    assert (weights[height > 0.65, 1] > 0.9).all()


def test_equal_bones_meet_in_the_middle_and_the_stronger_takes_more() -> None:
    skeleton, bind = chain((0, 0, 0), (0, 0.5, 0), (0, 1, 0))
    lattice, _, _ = build_lattices(box((-0.15, 0, -0.15), (0.15, 1, 0.15)), 0.05)
    bones = skeleton_bones(skeleton, bind[:, :3, 3], 0.03)
    middle = np.abs(lattice.particles[:, 1] - 0.5) < 0.06
    off_axis = np.abs(lattice.particles[:, 0]) > 0.05
    even = heat_weights(lattice, bones, skeleton)[middle & off_axis]
    bones.strength[1] = 3.0
    uneven = heat_weights(lattice, bones, skeleton)[middle & off_axis]
    assert (uneven[:, 1] >= even[:, 1]).all()
    assert uneven[:, 1].mean() > even[:, 1].mean() + 0.05


def test_conductance_is_symmetric_and_falls_with_distance() -> None:
    lattice, _, _ = build_lattices(box((0, 0, 0), (1, 1, 1)), 0.3)
    wt = conductance(lattice)
    assert abs(wt - wt.T).max() == 0
    row = wt[0].toarray()[0]
    distance = np.linalg.norm(lattice.particles - lattice.particles[0], axis=1) / lattice.cell_size
    joined_to = np.flatnonzero(row)
    np.testing.assert_allclose(row[joined_to], 1 / (1 + distance[joined_to]))


def test_no_leg_follows_the_other() -> None:
    mesh, skeleton, bind = two_legs(gap=0.008)
    positions = bind[:, :3, 3]
    lattice, _, _ = build_lattices(mesh, 0.04)
    weights = heat_weights(lattice, skeleton_bones(skeleton, positions, 0.02), skeleton)
    apart = separate_branches(weights, skeleton, positions)
    np.testing.assert_allclose(apart.sum(axis=1), 1, atol=1e-12)
    assert apart.min() >= 0
    left, right = subtree(skeleton, 2), subtree(skeleton, 5)
    assert (np.minimum(apart[:, left].sum(axis=1), apart[:, right].sum(axis=1)) < 1e-12).all()
    on_vertices = np.einsum("vk,vkj->vj", lattice.vertex_weights, apart[lattice.cells[lattice.vertex_cells]])
    left_leg = (mesh.vertices[:, 0] > 0) & (mesh.vertices[:, 1] < -0.02)
    assert on_vertices[left_leg][:, right].max() < 0.02


def test_a_lone_piece_follows_the_nearest_bone() -> None:
    skeleton, bind = chain((0, 0, 0), (0, 0.5, 0), (0, 1, 0))
    mesh = joined(box((-0.1, 0, -0.1), (0.1, 1, 0.1)), box((0.3, 0.8, 0), (0.4, 0.9, 0.1)))
    lattice, _, _ = build_lattices(mesh, 0.05)
    weights = heat_weights(lattice, skeleton_bones(skeleton, bind[:, :3, 3], 0.03), skeleton)
    assert (weights[lattice.particles[:, 0] > 0.25, 1] > 0.9).all()


def test_a_skeleton_beside_the_mesh_is_refused() -> None:
    skeleton, bind = chain((0, 100, 0), (0, 150, 0))
    lattice, _, _ = build_lattices(box((0, 0, 0), (1, 1, 1)), 0.2)
    with pytest.raises(SixpointError, match="outside the mesh"):
        heat_weights(lattice, skeleton_bones(skeleton, bind[:, :3, 3], 0.1), skeleton)


def test_a_skeleton_without_extent_is_refused() -> None:
    skeleton, _ = chain((0, 0, 0), (0, 0, 0))
    with pytest.raises(SixpointError, match="no bone"):
        skeleton_bones(skeleton, at(np.zeros((2, 3)))[:, :3, 3], 0.1)


def test_distance_to_a_bone_is_to_its_segment() -> None:
    skeleton, bind = chain((0, 0, 0), (0, 1, 0))
    bones = skeleton_bones(skeleton, bind[:, :3, 3], 0.1)
    points = np.array([[0, 0.5, 2.0], [0, -3, 0], [0, 2, 0]])
    np.testing.assert_allclose(bone_distances(bones, points)[:, 0], [2, 3, 1])


def test_steps_in_the_tree() -> None:
    _, skeleton, _ = two_legs()
    apart = joints_apart(skeleton)
    assert apart[3, 6] == 4
    assert apart[2, 3] == 1
    assert (np.diag(apart) == 0).all()


def test_the_strongest_are_kept_in_order_and_sum_to_one() -> None:
    joints, weights = strongest(np.array([[0.1, 0.4, 0.3, 0.15, 0.05], [0, 1.0, 0, 0, 0]]))
    np.testing.assert_array_equal(joints, [[1, 2, 3, 0], [1, 0, 0, 0]])
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    assert (np.diff(weights, axis=1) <= 0).all()
