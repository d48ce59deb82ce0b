"""The mannequin: what any body must hold, for skeletons of different make."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from deformation.mannequin import RESOLUTIONS, mannequin, mannequin_colours
from deformation.mannequin.field import ellipsoid, loft, project, smooth_cut, smooth_union
from deformation.mesh import Mesh, all_quads, components, euler_characteristic, is_closed, vertex_normals, volume
from devices.errors import SettingError
from reconstruction.motion import Pose
from reconstruction.motion_files.bvh import read_bvh
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton

_MOCAP = Path(__file__).parents[2] / ".." / "shared" / "mocap"
_CLIPS = {
    "cmu": _MOCAP / "cmu" / "cmu_train_walking_1.bvh",
    "bandai": _MOCAP / "bandai1" / "dataset-1_walk_happy_001.bvh",
}
_SIZES = {"low": (6500, 7500), "medium": (12500, 13500), "high": (27000, 29000)}
_FLESH_KG_PER_M3 = 985.0


@cache
def body(name: str, resolution: str = "low") -> tuple[Skeleton, Mesh, NDArray[np.float64]]:
    """Skeleton, mesh and joints (J, 4, 4); skips where the skeleton's file is not at hand."""
    skeleton, reference = _skeleton(name)
    return skeleton, *mannequin(skeleton, resolution, reference)


def _skeleton(name: str) -> tuple[Skeleton, Pose | None]:
    if name == "standard":
        return standard_skeleton(1.75), None
    if name == "child":
        return standard_skeleton(1.15), None
    if not _CLIPS[name].is_file():
        pytest.skip("needs the shared motion capture beside the repository")
    motion = read_bvh(_CLIPS[name])
    return motion.skeleton, motion.pose(0)


_bodies = pytest.mark.parametrize("name", ["standard", "child", "cmu", "bandai"])


@_bodies
def test_one_closed_surface_of_quads_without_handles(name: str):
    _, mesh, _ = body(name)
    assert len(mesh.triangles) == 0
    assert is_closed(mesh)
    assert euler_characteristic(mesh) == 2
    assert components(mesh).max() == 0
    assert volume(mesh) > 0


@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_sizes_and_weight(resolution: str):
    _, mesh, _ = body("standard", resolution)
    low, high = _SIZES[resolution]
    assert low < len(mesh.vertices) < high
    assert 60 < volume(mesh) * _FLESH_KG_PER_M3 < 85
    assert len(mannequin_colours(mesh)) == len(mesh.vertices)


@_bodies
def test_stands_on_the_floor_facing_ahead(name: str):
    _, mesh, _ = body(name)
    assert abs(mesh.vertices[:, 1].min()) < 0.004
    assert mesh.vertices[:, 2].max() > -mesh.vertices[:, 2].min()


@_bodies
def test_joints_are_inside(name: str):
    skeleton, mesh, transforms = body(name)
    joints = transforms[list(skeleton.humanoid.values()), :3, 3]
    turns = _winding_numbers(joints, mesh)
    assert (turns > 0.9).all(), [b for b, w in zip(skeleton.humanoid, turns, strict=True) if w <= 0.9]


def _winding_numbers(points: NDArray[np.float64], mesh: Mesh) -> NDArray[np.float64]:
    """How often the surface goes around each point (Van Oosterom and Strackee 1983)."""
    a, b, c = (mesh.vertices[mesh.triangulated[:, i]] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    triple = np.einsum("...i,...i", a, np.cross(b, c))
    dots = [np.einsum("...i,...i", *pair) for pair in ((a, b), (b, c), (c, a))]
    below = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return np.arctan2(triple, below).sum(axis=1) / (2 * np.pi)


@_bodies
def test_knees_and_elbows_are_in_the_middle_of_their_limbs(name: str):
    skeleton, mesh, transforms = body(name)
    for bone, before, after in (("lower_leg", "upper_leg", "foot"), ("lower_arm", "upper_arm", "hand")):
        for side in ("left", "right"):
            joint, start, end = (transforms[skeleton.humanoid[f"{side}_{b}"], :3, 3] for b in (bone, before, after))
            along = (end - start) / np.linalg.norm(end - start)
            offset = mesh.vertices - joint
            ring = offset[(np.abs(offset @ along) < 0.02) & (np.linalg.norm(offset, axis=1) < 0.12)]
            middle = ring.mean(axis=0) - (ring.mean(axis=0) @ along) * along
            assert len(ring) > 15
            assert np.linalg.norm(middle) < 0.015


def test_left_mirrors_right():
    _, mesh, _ = body("standard")
    distance, _ = cKDTree(mesh.vertices).query(mesh.vertices * [-1, 1, 1])
    assert distance.max() < 1e-6


@_bodies
def test_no_face_is_folded_over_its_neighbours(name: str):
    _, mesh, _ = body(name)
    normals = vertex_normals(mesh.vertices, mesh.triangulated)
    a, b, c = (mesh.vertices[mesh.triangulated[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-15)
    facing = np.einsum("fi,fci->fc", face, normals[mesh.triangulated]).max(axis=1)
    assert (facing > 0).mean() > 0.999


@pytest.mark.parametrize(("name", "resolution"), [("standard", "low"), ("cmu", "low"), ("bandai", "low")])
def test_no_face_crosses_another(name: str, resolution: str):
    open3d = pytest.importorskip("open3d", reason="Open3D does not load here", exc_type=ImportError)
    _, mesh, _ = body(name, resolution)
    shape = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(mesh.vertices.copy()), open3d.utility.Vector3iVector(mesh.triangulated.copy())
    )
    assert len(shape.get_self_intersecting_triangles()) == 0


def test_every_skeleton_gets_the_same_faces():
    assert np.array_equal(body("standard")[1].quads, body("child")[1].quads)


def test_an_unknown_resolution_and_a_foreign_mesh_are_refused():
    with pytest.raises(SettingError, match="use low, medium, high"):
        mannequin(standard_skeleton(), "ultra")
    with pytest.raises(SettingError, match="no mannequin"):
        mannequin_colours(all_quads(np.zeros((4, 3)), np.array([[0, 1, 2, 3]])))


def test_an_ellipsoid_is_exact_on_its_axes_and_its_surface_is_found():
    shape = ellipsoid(np.array([0.1, 0.2, 0.3]), [0.05, 0.07, 0.04])
    tips = np.array([0.1, 0.2, 0.3]) + np.diag([0.05, 0.07, 0.04])
    assert np.allclose(shape(tips), 0, atol=2e-6)
    points = np.random.default_rng(2).normal(size=(200, 3)) * 0.05 + [0.1, 0.2, 0.3]
    for _ in range(12):
        points, normals = project(shape, points)
    assert np.abs(shape(points)).max() < 1e-5
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-3)


def test_a_loft_has_its_radii_at_its_stations():
    radii = [[0.03, 0.02, 0.04, 0.01], [0.05, 0.05, 0.05, 0.05]]
    up, ahead = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    shape = loft(np.zeros(3), up, ahead, [0.0, 0.2], radii, (0.01, 0.01))
    around = np.array([[0.03, 0, 0], [-0.02, 0, 0], [0, 0, 0.04], [0, 0, -0.01], [0.05, 0.2, 0], [0, 0.21, 0]])
    assert np.allclose(shape(around), 0, atol=1e-6)


def test_smooth_union_only_adds_and_smooth_cut_only_removes():
    a, b = np.random.default_rng(3).normal(size=(2, 500))
    assert (smooth_union(a, b, 0.5) <= np.minimum(a, b)).all()
    assert (smooth_cut(a, b, 0.5) >= np.maximum(a, -b)).all()
    apart = np.abs(a - b) > 0.5
    assert np.array_equal(smooth_union(a, b, 0.5)[apart], np.minimum(a, b)[apart])
