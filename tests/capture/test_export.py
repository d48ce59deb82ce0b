import numpy as np
import pytest
from pygltflib import GLTF2
from scipy.spatial.transform import Rotation

from capture.export import motion_writer, read_csv, read_npz, write_csv, write_motion, write_npz
from capture.joint_presets import PRESETS, renamed_skeleton
from deformation.character import mannequin_character
from devices.errors import FileError, SettingError
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_files import read_bvh
from reconstruction.standard_body import standard_skeleton
from tests.capture.test_glb import posed_nodes


@pytest.fixture
def motion() -> Motion:
    skeleton, random = standard_skeleton(1.8), np.random.default_rng(2)
    rotations = Rotation.random(12 * len(skeleton), random_state=3).as_quat().reshape(12, len(skeleton), 4)
    return Motion(skeleton, random.normal(size=(12, 3)), rotations, 59.94, "random")


def test_npz_comes_back_bit_for_bit(motion, tmp_path):
    write_npz(motion, tmp_path / "a.npz")
    back = read_npz(tmp_path / "a.npz")
    assert back.skeleton.names == motion.skeleton.names
    assert np.array_equal(back.skeleton.parents, motion.skeleton.parents)
    assert np.array_equal(back.skeleton.offsets, motion.skeleton.offsets)
    assert np.array_equal(back.root_positions, motion.root_positions)
    assert np.array_equal(back.rotations, motion.rotations)
    assert (back.fps, back.name) == (motion.fps, motion.name)


def test_csv_comes_back_bit_for_bit_and_holds_world_positions(motion, tmp_path):
    write_csv(motion, tmp_path / "a.csv")
    back = read_csv(tmp_path / "a.csv", motion.skeleton)
    assert np.array_equal(back.root_positions, motion.root_positions)
    assert np.array_equal(back.rotations, motion.rotations)
    assert back.fps == pytest.approx(motion.fps)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    column = lines[0].split(",").index("LeftHand.y_m")
    positions, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    hand = motion.skeleton.names.index("LeftHand")
    assert float(lines[8].split(",")[column]) == positions[7, hand, 1]


def test_bvh_comes_back_as_the_same_motion(motion, tmp_path):
    write_motion(motion, tmp_path / "a.bvh")
    back = read_bvh(tmp_path / "a.bvh")
    mine, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    theirs, _ = world_joints(back.skeleton, back.root_positions, back.rotations)
    order = [back.skeleton.names.index(name) for name in motion.skeleton.names]
    assert np.abs(mine - theirs[:, order]).max() < 1e-5


@pytest.fixture(scope="module")
def character():
    return mannequin_character(standard_skeleton(1.8), "low")


@pytest.mark.parametrize("preset", [None, *PRESETS])
def test_every_format_gives_back_the_motion_under_every_programs_names(motion, character, tmp_path, preset):
    for ending in (".bvh", ".csv", ".npz", ".glb"):
        write_motion(motion, tmp_path / f"a{ending}", character, preset)
    skeleton = motion.skeleton if preset is None else renamed_skeleton(motion.skeleton, preset)
    assert len(set(skeleton.names)) == len(skeleton)
    for back in (read_npz(tmp_path / "a.npz"), read_csv(tmp_path / "a.csv", skeleton)):
        assert back.skeleton.names == skeleton.names
        assert np.array_equal(back.root_positions, motion.root_positions)
        assert np.array_equal(back.rotations, motion.rotations)
    places, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    read = read_bvh(tmp_path / "a.bvh")
    order = [read.skeleton.names.index(name) for name in skeleton.names]
    assert set(read.skeleton.names) == set(skeleton.names)
    assert np.abs(places - world_joints(read.skeleton, read.root_positions, read.rotations)[0][:, order]).max() < 1e-5
    gltf = GLTF2().load(tmp_path / "a.glb")
    assert tuple(node.name for node in gltf.nodes[: len(skeleton)]) == skeleton.names
    for frame in (0, 11):
        assert np.abs(posed_nodes(gltf, frame)[: len(skeleton), :3, 3] - places[frame]).max() < 1e-5


@pytest.mark.parametrize("ending", [".bvh", ".csv", ".npz", ".glb", ".vrma"])
def test_each_ending_is_written_whole_and_alone(motion, tmp_path, ending):
    write_motion(motion, tmp_path / f"a{ending}")
    assert [path.name for path in tmp_path.iterdir()] == [f"a{ending}"]
    assert (tmp_path / f"a{ending}").stat().st_size > 1000


def test_an_unknown_ending_lists_the_known_ones():
    with pytest.raises(SettingError, match=r"\.bvh, \.glb, \.vrma, \.csv, \.npz"):
        motion_writer("dance.fbx")


def test_a_full_disk_leaves_the_old_file(motion, tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    write_npz(motion, path)
    before = path.read_bytes()

    def full(*_args, **_named):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OSError, match="No space"):
        write_npz(motion, path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_files_of_another_kind_are_named(motion, tmp_path):
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"PK\x03\x04 nothing")
    for path, words in ((broken, "not a motion"), (tmp_path / "none.npz", "no such file")):
        with pytest.raises(FileError, match=words):
            read_npz(path)
    table = tmp_path / "table.csv"
    for text, words in (("time_s,a\n0,1\n", "columns"), ("time_s\nx\n", "numbers"), ("", "columns")):
        table.write_text(text)
        with pytest.raises(FileError, match=words):
            read_csv(table, motion.skeleton)
    with pytest.raises(FileError, match="no such file"):
        read_csv(tmp_path / "none.csv", motion.skeleton)
