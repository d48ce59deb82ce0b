import json
import shutil

import numpy as np
import pytest

from devices.errors import FileError, SixpointError
from reconstruction.database import build_database, open_database
from reconstruction.gathering import gather
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.rotations import about_up, multiply, rotate
from reconstruction.skeleton import Skeleton
from tests.reconstruction.conftest import strolling


def test_keeps_the_motions(database):
    clip = database.clips[2]
    kept, true = database.motion(clip), strolling(2)
    assert kept.name == true.name
    now, _ = world_joints(kept.skeleton, kept.root_positions, kept.rotations)
    then, _ = world_joints(true.skeleton, true.root_positions, true.rotations)
    apart = np.linalg.norm(now[:, 3] - now[:, 9], axis=-1) - np.linalg.norm(then[:, 3] - then[:, 9], axis=-1)
    np.testing.assert_allclose(apart, 0, atol=1e-5)
    np.testing.assert_allclose(np.diff(now[..., 1], axis=0), np.diff(then[..., 1], axis=0), atol=1e-5)


def test_windows_never_cross_clips(database):
    starts = {clip.first + back for clip in database.clips for back in range(3)}
    assert not starts & set(database.windows.tolist())
    assert len(database.windows) == len(database) - 3 * len(database.clips)


def test_a_window_finds_itself(database):
    rows = np.sort(database.windows)[::97].astype(np.int64)
    following = gather(rows, 0, np.asarray(database.poses), np.asarray(database.headings))
    assert np.abs(following[:, [0, 2]]).max() < 0.05  # a frame's way, metres
    assert database.clip_of(int(rows[0])).name == "stroll 0"


def test_rows_seen_from_the_frame_before_are_rigid_motions_of_the_world(database):
    rows = np.sort(database.windows)[5:8].astype(np.int64)
    seen = gather(rows, 0, np.asarray(database.poses), np.asarray(database.headings))
    clip = database.motion(database.clips[0])
    frame = database.headings[rows - 1].astype(np.float64)
    own = database.space.root_positions(seen, frame)
    np.testing.assert_allclose(own, clip.root_positions[rows], atol=1e-5)
    turned = database.space.rotations(seen, frame)
    np.testing.assert_allclose(np.abs(np.sum(turned * clip.rotations[rows], axis=-1)), 1, atol=1e-5)


def test_place_and_facing_in_the_world_do_not_matter(tmp_path, database):
    def moved(motion: Motion) -> Motion:
        turn = np.tile(about_up(np.array(2.0)), (len(motion), 1))
        rotations = motion.rotations.copy()
        rotations[:, 0] = multiply(turn, rotations[:, 0])
        path = rotate(turn, motion.root_positions) + np.array([9.0, 0, 5.0])
        return Motion(motion.skeleton, path, rotations, 60.0, "moved")

    other = build_database((moved(strolling(seed)) for seed in range(12)), tmp_path / "moved")
    np.testing.assert_allclose(other.poses, database.poses, atol=2e-4)


def test_bodies_of_several_sizes_share_one_scale(tmp_path):
    mixed = build_database([strolling(0, stature_m=1.5), strolling(0, stature_m=2.0)], tmp_path / "mixed")
    half = mixed.clips[1].first
    np.testing.assert_allclose(mixed.poses[:half], mixed.poses[half:], atol=1e-4)


def test_resamples_and_mirrors(tmp_path):
    built = build_database([strolling(0, 240, 120.0)], tmp_path / "m", fps=60.0, mirror=True)
    assert [clip.frames for clip in built.clips] == [120, 120]
    assert built.info()["poses"] == 240


def test_refuses_what_cannot_be_a_database(tmp_path, database):
    with pytest.raises(FileError, match="no motion"):
        build_database([], tmp_path / "empty")
    with pytest.raises(FileError, match="longer than"):
        build_database([strolling(0, 3)], tmp_path / "short")
    one = strolling(0)
    fewer = Skeleton((*one.skeleton.names[:-1], "Extra"), one.skeleton.parents, one.skeleton.offsets)
    other = Motion(fewer, one.root_positions, one.rotations, 60.0, "the other")
    with pytest.raises(SixpointError, match=r"the other.*Extra"):
        build_database([one, other], tmp_path / "mixed")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("keep me")
    with pytest.raises(FileError, match="not a motion database"):
        build_database([one], tmp_path / "mine")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine"]


def test_an_older_database_is_replaced_whole(tmp_path):
    build_database([strolling(0)], tmp_path / "d")
    assert len(build_database([strolling(0), strolling(1)], tmp_path / "d").clips) == 2


def test_opening_says_what_is_wrong(tmp_path, database):
    with pytest.raises(FileError, match="no such database"):
        open_database(tmp_path / "nowhere")
    with pytest.raises(FileError, match="not a motion database"):
        open_database(tmp_path)
    for name in ("poses.npy", "index.faiss"):
        broken = tmp_path / name.split(".")[0]
        shutil.copytree(database.path, broken)
        whole = (broken / name).read_bytes()
        (broken / name).write_bytes(whole[: len(whole) // 2])
        with pytest.raises(FileError, match=f"{name}.*build the database again"):
            open_database(broken)
    newer = tmp_path / "newer"
    shutil.copytree(database.path, newer)
    manifest = json.loads((newer / "manifest.json").read_text())
    (newer / "manifest.json").write_text(json.dumps(manifest | {"version": 99}))
    with pytest.raises(FileError, match="version 99"):
        open_database(newer)


def test_the_index_recalls_the_true_neighbours(database):
    rng = np.random.default_rng(0)
    stored = database.index.vectors()
    for query in stored[rng.choice(len(stored), 20)] + rng.normal(0, 0.01, (20, stored.shape[1])).astype(np.float32):
        numbers, distances = database.index.nearest(query, 48)
        exact = np.sort(np.linalg.norm(stored - query, axis=1))[:48]
        assert np.mean(distances <= exact[-1] * (1 + 1e-4)) >= 0.99
        np.testing.assert_allclose(distances[0], exact[0], rtol=1e-3)
        assert len(set(numbers.tolist())) == 48
