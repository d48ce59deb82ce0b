"""Pictures in a row: a folder of PNG frames, a GIF, or an MP4."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.raster import save_png
from devices.errors import SixpointError, choice_error

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
    with _beside(path) as partial:
        write(_some(images, path), partial, fps)


def write_frames(images: Iterable[NDArray[np.uint8]], folder: str | Path) -> list[Path]:
    """Writes pictures as `frame_00000.png`, `frame_00001.png`, ... into a folder; makes it. Raises OSError."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for index, image in enumerate(images):
        paths.append(folder / f"frame_{index:05d}.png")
        save_png(image, paths[-1])
    return paths


@contextmanager
def _beside(path: Path) -> Iterator[Path]:
    partial = path.with_name(f".{path.stem}.partial{path.suffix}")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


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
    """H.264 in YUV 4:2:0, that every browser plays; odd sides lose their last pixel."""
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise SixpointError("MP4 needs the package imageio-ffmpeg; install it or write a .gif") from error
    writer = None
    try:
        for image in images:
            even = np.ascontiguousarray(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])
            if writer is None:
                size = (even.shape[1], even.shape[0])
                writer = imageio_ffmpeg.write_frames(
                    str(path),
                    size,
                    fps=fps,  # type: ignore[arg-type]  # takes fractions, though its stub says int
                    quality=8,
                    macro_block_size=2,
                    ffmpeg_log_level="error",
                )
                writer.send(None)
            writer.send(even)
    finally:
        if writer is not None:
            writer.close()
