"""The paper's matching: triangles stay similar, joints lie by length, and a body gets every joint."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from deformation.auto_rig import RigSettings, rig_mesh
from deformation.curve_skeleton import line_through
from deformation.mannequin import mannequin
from deformation.rig_templates import HUMAN_TREE
from deformation.template_matching import by_length, matched_triangle, shares_of, template_joints
from devices.errors import SettingError
from reconstruction.standard_body import standard_skeleton


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**31))
def test_matched_triangles_are_similar(seed: int) -> None:
    random = np.random.default_rng(seed)
    p, q, r, a, b = random.normal(size=(5, 3))
    c = matched_triangle((p, q, r), a, b)

    def ratios(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> list[float]:
        sides = [float(np.linalg.norm(v)) for v in (x - z, y - z, x - y)]
        return [sides[0] / sides[2], sides[1] / sides[2], sides[0] / sides[1]]

    np.testing.assert_allclose(ratios(a, b, c), ratios(p, q, r), rtol=1e-6)
    turn, shift = Rotation.from_euler("y", random.uniform(-1, 1)), random.normal(size=3)
    moved = matched_triangle((p, q, r), 2 * p + shift, 2 * q + shift)
    np.testing.assert_allclose(moved, 2 * r + shift, atol=1e-9)
    assert np.linalg.norm(matched_triangle((p, q, r), turn.apply(p), turn.apply(q)) - turn.apply(q)) == pytest.approx(
        np.linalg.norm(r - q)
    )


def test_joints_lie_by_length() -> None:
    chain = [np.array([0.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 1.0, 3.0])]
    assert shares_of(chain) == [0.25]
    line = line_through(np.array([[0.0, 0, 0], [2.0, 0, 0], [2.0, 2.0, 0]]), np.ones(3))
    np.testing.assert_allclose(by_length(line, [0.25, 0.75]), [[1, 0, 0], [2, 1, 0]])


def test_the_template_is_a_whole_person() -> None:
    joints = template_joints()
    assert {name for name, _ in HUMAN_TREE} == set(joints)
    assert joints["left_hand"][0] > 0


@pytest.mark.parametrize("form", ["midpoint", "triangle"])
def test_a_body_gets_every_joint_near_its_place(form: str) -> None:
    skeleton = standard_skeleton()
    mesh, bind = mannequin(skeleton, "low")
    found = rig_mesh(mesh, RigSettings(matching=form))
    assert {name for name, _ in HUMAN_TREE} <= set(found.rig.skeleton.names)
    places = found.rig.bind[:, :3, 3]
    off = [
        np.linalg.norm(places[found.rig.skeleton.humanoid[bone]] - bind[joint, :3, 3])
        for bone, joint in skeleton.humanoid.items()
    ]
    assert np.mean(off) < 0.09
    arms = [places[found.rig.skeleton.names.index(f"{side}_upper_arm")] for side in ("left", "right")]
    neck = places[found.rig.skeleton.names.index("neck")]
    assert (abs(neck[1] - np.mean(arms, axis=0)[1]) < 1e-9) == (form == "midpoint")


def test_wrong_settings_are_named() -> None:
    for name in ("template", "curves", "matching"):
        with pytest.raises(SettingError, match=name):
            RigSettings(**{name: "nonsense"})
