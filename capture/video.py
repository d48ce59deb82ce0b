"""Pictures in a row: a folder of PNG frames, a GIF, or an MP4."""

import subprocess
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.raster import save_png
from devices.errors import SixpointError, choice_error
from replay_logs.atomic_file import written_beside

_ENDINGS = (".gif", ".mp4")


def write_video(images: Iterable[NDArray[np.uint8]], path: str | Path, fps: float = 30.0) -> None:
    """Writes pictures (H, W, 3) sRGB as the GIF or MP4 that the ending names, beside and renamed into place.

    A GIF's frame times are whole hundredths of a second: 30 frames a second become 33.3 by the file's own clock.
    Raises SettingError for another ending, SixpointError where there is no picture or no MP4 encoder, OSError.
    """
    path = Path(path)
    if path.suffix.lower() not in _ENDINGS:
        raise choice_error("video ending", path.suffix, _ENDINGS)
    write = _write_gif if path.suffix.lower() == ".gif" else _write_mp4
    with written_beside(path) as part:
        write(_some(images, path), part, fps)


def write_frames(images: Iterable[NDArray[np.uint8]], folder: str | Path) -> list[Path]:
    """Writes pictures as `frame_00000.png`, `frame_00001.png`, ... into a folder; makes it. Raises OSError."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for index, image in enumerate(images):
        paths.append(folder / f"frame_{index:05d}.png")
        save_png(image, paths[-1])
    return paths


def _some(images: Iterable[NDArray[np.uint8]], path: Path) -> Iterator[NDArray[np.uint8]]:
    empty = True
    for image in images:
        empty = False
        yield image
    if empty:
        raise SixpointError(f"{path}: no pictures to write; give at least one frame")


def _write_gif(images: Iterator[NDArray[np.uint8]], path: Path, fps: float) -> None:
    """One palette of 256 colours for all frames, from the first, middle and last one: no flicker, a small file."""
    from PIL import Image

    pictures = [Image.fromarray(image) for image in images]
    chosen = [pictures[i] for i in sorted({0, len(pictures) // 2, len(pictures) - 1})]
    width, height = chosen[0].size
    strip = Image.new("RGB", (width, height * len(chosen)))
    for row, picture in enumerate(chosen):
        strip.paste(picture, (0, row * height))
    palette = strip.quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    milliseconds = max(10 * round(100 / fps), 20)
    frames[0].save(
        path, format="GIF", save_all=True, append_images=frames[1:], duration=milliseconds, loop=0, optimize=False
    )


def _write_mp4(images: Iterator[NDArray[np.uint8]], path: Path, fps: float) -> None:
    """H.264 in YUV 4:2:0, which every browser plays; odd sides lose their last pixel."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError as error:
        raise SixpointError("MP4 needs the package imageio-ffmpeg; install it or write a .gif") from error
    first = next(images)
    rows, columns = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{columns}x{rows}", "-r", f"{fps:g}", "-i", "-"]
    encoding = ["-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = [get_ffmpeg_exe(), "-y", "-loglevel", "error", *source, *encoding, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL) as encoder:
        assert encoder.stdin is not None
        try:
            for image in chain([first], images):
                encoder.stdin.write(np.ascontiguousarray(image[:rows, :columns]).data)
        except BrokenPipeError:
            pass
        except BaseException:
            encoder.kill()
            raise
    if encoder.returncode != 0:
        raise SixpointError(f"{path}: the video encoder gave up (status {encoder.returncode}); is the disk full?")
