"""Idle, live and clip: what is shown never jumps, and ends where it was asked to."""

import time
from itertools import pairwise

import numpy as np
import pytest
from pythonosc.udp_client import SimpleUDPClient
from scipy.spatial.transform import Rotation

from capture.director import Act, make_director
from capture.remote import ADDRESS, listening, orders
from devices.errors import SettingError
from reconstruction.motion import Pose
from reconstruction.motion_library import actions
from reconstruction.motion_library.actions import play

FPS = 60.0


def motion(action, seed):
    rng = np.random.default_rng(seed)
    return play(getattr(actions, action)(rng), 1.75, rng, action)


@pytest.fixture(scope="module")
def walk():
    return motion("walk", 3)


@pytest.fixture
def director(walk):
    return make_director(walk.skeleton, walk.pose(0), motion("golf", 1))


def shown_over(director, walk, asks):
    """The poses shown for a walk, with acts asked for at frames."""
    poses = []
    for frame in range(300):
        if frame in asks:
            director.ask(asks[frame])
        poses.append(director.shown(walk.pose(frame)))
    return poses


def largest_turn(poses):
    """Degrees that any joint turns from one pose to the next at most."""
    pairs = list(pairwise(poses))
    turns = [(Rotation.from_quat(a.rotations).inv() * Rotation.from_quat(b.rotations)).magnitude() for a, b in pairs]
    return np.degrees(np.max(turns))


def test_it_comes_from_idling_to_the_performer(director, walk):
    poses = shown_over(director, walk, {})
    assert np.linalg.norm(poses[0].rotations - walk.rotations[0]) > 1e-3
    np.testing.assert_array_equal(poses[120].rotations, walk.rotations[120])
    assert director.act is Act.LIVE


def test_no_change_of_act_makes_a_seam(director, walk):
    poses = shown_over(director, walk, {100: Act.CLIP, 180: Act.LIVE, 240: Act.IDLE})
    assert largest_turn(poses) < max(2.0 * largest_turn([walk.pose(frame) for frame in range(300)]), 15)
    places = np.array([pose.root_position for pose in poses])
    assert np.linalg.norm(np.diff(places, 2, axis=0), axis=1).max() * FPS**2 < 20


def test_a_clip_that_ends_gives_the_performer_back(walk):
    short = motion("golf", 1)
    short = type(short)(short.skeleton, short.root_positions[:60], short.rotations[:60], FPS, "short")
    director = make_director(walk.skeleton, walk.pose(0), short)
    poses = shown_over(director, walk, {60: Act.CLIP})
    assert director.act is Act.LIVE
    np.testing.assert_array_equal(poses[-1].rotations, walk.rotations[299])


def test_a_clip_of_other_joints_is_carried_over(walk):
    from dataclasses import replace

    other = motion("golf", 1)
    names = tuple(name.replace("Left", "L_").replace("Right", "R_") for name in other.skeleton.names)
    foreign = type(other)(replace(other.skeleton, names=names), other.root_positions, other.rotations, FPS, "foreign")
    director = make_director(walk.skeleton, walk.pose(0), foreign)
    assert len(shown_over(director, walk, {50: Act.CLIP})[-1].rotations) == len(walk.skeleton)


def test_acts_are_asked_for_over_osc(director, walk):
    with listening(orders(director), 0) as port:
        client = SimpleUDPClient("127.0.0.1", port)
        for frame in range(400):
            if frame % 10 == 5:
                client.send_message(ADDRESS, "nonsense")
                client.send_message(ADDRESS, "clip")
            pose = walk.pose(frame % len(walk))
            director.shown(Pose(frame / FPS, pose.root_position, pose.rotations))
            if director.act is Act.CLIP:
                break
            time.sleep(0.01)
        client._sock.close()
    assert director.act is Act.CLIP


def test_a_port_in_use_is_told(director):
    with (
        listening(orders(director), 0) as port,
        pytest.raises(SettingError, match=str(port)),
        listening(orders(director), port),
    ):
        pass
