import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from capture.scene import (
    BONE,
    STANDING_COLOURS,
    Camera,
    Scene,
    Spheres,
    Surface,
    ghost_marks,
    side_by_side,
    skeleton_marks,
    tracker_spheres,
)
from capture.standings import Standing
from devices.frame import TrackerFrame
from reconstruction.kinematics import world_joints
from reconstruction.standard_body import standard_skeleton

angles = st.floats(-3.0, 3.0)


@given(angles, st.floats(-1.5, 1.5))
def test_camera_axes_are_a_rotation_and_look_at_the_target(yaw, pitch):
    camera = Camera(target=(0.3, 1.0, -2.0), distance=3.0, yaw=yaw, pitch=pitch)
    assert np.allclose(camera.axes @ camera.axes.T, np.eye(3))
    assert np.isclose(np.linalg.det(camera.axes), 1)
    target_in_camera = camera.axes @ (np.array(camera.target) - camera.eye)
    assert np.allclose(target_in_camera, [0, 0, -3])
    assert camera.axes[0, 1] == 0, "the horizon stays level"


def test_a_camera_at_yaw_zero_faces_the_performer():
    camera = Camera(yaw=0, pitch=0)
    assert np.allclose(camera.axes, np.eye(3))
    assert camera.eye[2] > 0


@given(angles, st.floats(-1.2, 1.2), st.integers(0, 1000))
def test_framed_points_fit_and_fill_the_picture(yaw, pitch, seed):
    points = np.random.default_rng(seed).normal(size=(30, 3))
    camera = Camera(yaw=yaw, pitch=pitch).framed(points, aspect=1.5, margin=1.0)
    seen = (points - camera.eye) @ camera.axes.T
    half = math.tan(camera.fov / 2)
    x, y = seen[:, 0] / -seen[:, 2] / (1.5 * half), seen[:, 1] / -seen[:, 2] / half
    assert (seen[:, 2] < 0).all()
    reach = max(np.abs(x).max(), np.abs(y).max())
    assert 0.5 < reach <= 1 + 1e-9


def test_framing_nothing_leaves_the_camera_alone():
    assert Camera().framed(np.full((2, 3), np.nan)) == Camera()
    assert Scene().framed().camera == Camera()


def test_orbiting_stops_short_of_the_poles():
    camera = Camera(pitch=0).orbited(yaw=0.1, pitch=9.0, zoom=2.0)
    assert camera.pitch < math.pi / 2
    assert np.isclose(camera.distance, Camera().distance / 2)


def test_trackers_wear_the_colours_of_their_states():
    frame = TrackerFrame.from_positions(0.0, {"head": (0.0, 1.6, 0.0)})
    spheres = tracker_spheres(frame)
    assert np.allclose(np.asarray(spheres.colours)[1], STANDING_COLOURS[Standing.MEASURED])
    assert np.allclose(np.asarray(spheres.colours)[0], STANDING_COLOURS[Standing.LOST])
    assert np.isnan(spheres.centres[0]).all()


def test_skeleton_marks_join_every_joint_to_its_parent():
    skeleton = standard_skeleton()
    joints, _ = world_joints(skeleton, np.zeros(3), np.tile([0.0, 0, 0, 1], (len(skeleton), 1)))
    lines, spheres = skeleton_marks(skeleton, joints)
    assert len(lines.segments) == len(skeleton) - 1
    assert len(spheres.centres) == (~skeleton.is_end).sum()
    assert spheres.colours == BONE


def test_scene_points_hold_every_part():
    triangle = Surface(np.eye(3), np.array([[0, 1, 2]]))
    scene = Scene(surfaces=(triangle,), spheres=(Spheres(np.zeros((2, 3))),))
    assert scene.points().shape == (5, 3)


def test_ghosts_join_each_pose_within_itself():
    skeleton = standard_skeleton()
    joints = np.random.default_rng(0).normal(size=(3, len(skeleton), 3))
    ghosts = ghost_marks(skeleton, joints)
    assert len(ghosts.segments) == 3 * (len(skeleton) - 1)
    assert (ghosts.segments // len(skeleton) == ghosts.segments[:, :1] // len(skeleton)).all()


def test_side_by_side_keeps_both_and_puts_them_apart_across_the_picture():
    one = Scene(spheres=(Spheres(np.array([[0.0, 1, 0]])),), camera=Camera(yaw=0.7), title="a", status=("x",))
    both = side_by_side(one, Scene(spheres=(Spheres(np.array([[0.0, 1, 0]])),), title="b"), apart_m=2.0)
    left, right = both.points() @ both.camera.axes.T
    assert np.allclose(right - left, [2, 0, 0])
    assert both.title == "a"
    assert both.status == ("x",)
