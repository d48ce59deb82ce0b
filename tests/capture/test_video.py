import subprocess

import numpy as np
import pytest
from PIL import Image

from capture.video import write_frames, write_video
from devices.errors import SettingError, SixpointError


def pictures(count=5):
    for index in range(count):
        image = np.full((36, 64, 3), (200, 205, 210), np.uint8)
        image[10:20, 5 + 6 * index : 15 + 6 * index] = (180, 60, 40)
        yield image


def test_frames_are_numbered_and_exact(tmp_path):
    paths = write_frames(pictures(3), tmp_path / "frames")
    assert [p.name for p in paths] == ["frame_00000.png", "frame_00001.png", "frame_00002.png"]
    for path, picture in zip(paths, pictures(3), strict=True):
        assert np.array_equal(np.asarray(Image.open(path)), picture)


def test_a_gif_holds_every_frame_at_its_time(tmp_path):
    path = tmp_path / "walk.gif"
    write_video(pictures(), path, fps=25)
    with Image.open(path) as gif:
        assert gif.n_frames == 5
        assert gif.info["duration"] == 40
        assert gif.info["loop"] == 0
        for index, picture in enumerate(pictures()):
            gif.seek(index)
            difference = np.asarray(gif.convert("RGB")).astype(int) - picture
            assert np.abs(difference).max() < 16
    assert [p.name for p in tmp_path.iterdir()] == ["walk.gif"]


def test_an_mp4_holds_every_frame(tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / "walk.mp4"
    write_video(pictures(12), path, fps=25)
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    decoded = subprocess.run(command, capture_output=True, check=True)
    frames = np.frombuffer(decoded.stdout, np.uint8).reshape(-1, 36, 64, 3)
    assert b"25 fps" in decoded.stderr
    assert len(frames) == 12
    assert frames[5][15, 40].astype(int) == pytest.approx(np.array([180, 60, 40]), abs=40)


def test_no_pictures_and_unknown_endings_are_told_and_leave_nothing(tmp_path):
    with pytest.raises(SixpointError, match="no pictures"):
        write_video([], tmp_path / "none.gif")
    with pytest.raises(SettingError, match=r"\.gif, \.mp4"):
        write_video(pictures(), tmp_path / "walk.avi")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_half_way_leaves_nothing(tmp_path):
    def broken():
        yield next(pictures())
        raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        write_video(broken(), tmp_path / "walk.gif")
    assert list(tmp_path.iterdir()) == []
