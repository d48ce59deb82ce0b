import numpy as np
import pytest

from deformation.joint_centres import centred_joints
from deformation.lattice import build_lattices
from tests.deformation.bodies import box, chain, two_legs

LIMB = build_lattices(box((-0.1, 0, -0.1), (0.1, 1, 0.1), 12), 0.06)[0]


@pytest.mark.parametrize("off", [(0.05, -0.04), (-0.09, 0.0), (0.15, 0.02)])
def test_a_joint_beside_the_axis_is_drawn_to_it(off: tuple[float, float]) -> None:
    skeleton, bind = chain((0, 0.05, 0), (off[0], 0.5, off[1]), (0, 0.95, 0))
    moved_skeleton, moved = centred_joints(skeleton, bind[:, :3, 3], LIMB.voxels)
    assert np.abs(moved[1] - [0, 0.5, 0]).max() < 0.015
    np.testing.assert_array_equal(moved[[0, 2]], bind[[0, 2], :3, 3])
    np.testing.assert_allclose(moved_skeleton.offsets.cumsum(axis=0), moved)


def test_a_joint_on_the_axis_stays() -> None:
    skeleton, bind = chain((0, 0.05, 0), (0, 0.45, 0), (0, 0.95, 0))
    np.testing.assert_allclose(centred_joints(skeleton, bind[:, :3, 3], LIMB.voxels)[1], bind[:, :3, 3], atol=0.01)


def test_a_knee_is_not_drawn_into_the_other_leg() -> None:
    mesh, skeleton, bind = two_legs()
    lattice, rough = build_lattices(mesh, 0.05)[0], bind[:, :3, 3].copy()
    rough[3, 0] -= 0.05
    moved = centred_joints(skeleton, rough, lattice.voxels)[1]
    assert abs(moved[3, 0] - 0.0775) < 0.015
