"""The mannequin of a skeleton is made once, is the same from the cache, and never another's."""

import os
from dataclasses import replace

import numpy as np
import pytest

import capture.mannequin_cache as cache
from capture.mannequin_cache import cached_mannequin
from deformation.mannequin import mannequin, mannequin_colours
from reconstruction.standard_body import standard_skeleton


@pytest.fixture
def skeleton():
    return standard_skeleton()


@pytest.fixture
def made(monkeypatch):
    """Counts how often one is made."""
    count, make = [], cache._made
    monkeypatch.setattr(cache, "_made", lambda *args: count.append(args) or make(*args))
    return count


def test_what_is_cached_is_what_is_made(tmp_path, skeleton, made):
    mesh, bind = mannequin(skeleton, "low")
    for _ in range(2):
        found = cached_mannequin(skeleton, "low", folder=tmp_path)
        np.testing.assert_array_equal(found.mesh.vertices, mesh.vertices)
        np.testing.assert_array_equal(found.mesh.quads, mesh.quads)
        np.testing.assert_array_equal(found.bind, bind)
        np.testing.assert_array_equal(found.colours, mannequin_colours(mesh))
        assert not found.bind.flags.writeable
    assert len(made) == 1


def test_another_skeleton_or_pose_is_another_mannequin(skeleton):
    pose = cache.Pose(0.0, np.zeros(3), np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), 1)))
    taller = replace(skeleton, offsets=skeleton.offsets * 1.01)
    keys = [cache._key(s, "low", p) for s in (skeleton, taller) for p in (None, pose)]
    assert len({*keys, cache._key(skeleton, "high", None)}) == 5
    assert cache._key(standard_skeleton(), "low", None) == keys[0]


@pytest.mark.parametrize("broken", [b"", b"no zip", b"PK\x03\x04 but not whole"])
def test_a_broken_file_is_made_anew(tmp_path, skeleton, made, broken):
    cached_mannequin(skeleton, "low", folder=tmp_path)
    (file,) = tmp_path.glob("*.npz")
    file.write_bytes(broken)
    cached_mannequin(skeleton, "low", folder=tmp_path)
    assert len(made) == 2
    assert file.stat().st_size > 100_000
    assert list(tmp_path.iterdir()) == [file]


def test_where_nothing_can_be_written_it_is_made_each_time(tmp_path, skeleton, made):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    for _ in range(2):
        cached_mannequin(skeleton, "low", folder=blocked)
    assert len(made) == 2


def test_the_oldest_go(tmp_path, skeleton, monkeypatch):
    monkeypatch.setattr(cache, "_KEPT", 2)
    for age in range(3):
        path = tmp_path / f"{age}.npz"
        path.write_bytes(b"")
        os.utime(path, (1000 - age, 1000 - age))
    cached_mannequin(skeleton, "low", folder=tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert len(names) == 2
    assert "0.npz" in names
