"""`sixpoint deform`: a motion onto a character."""

from pathlib import Path
from typing import Annotated

import typer

from capture.commands.options import JointNames, Resolution
from devices.errors import SettingError, choice_error
from replay_logs.atomic_file import check_file_place, check_folder_place

_ENDINGS = (".glb", ".npz", ".gif", ".mp4", "a folder for PNG frames")


def deform(
    character: Annotated[str, typer.Argument(help="`mannequin`, or a character's file.")],
    motion: Annotated[Path, typer.Argument(help="The motion: .bvh, .amc, or an .npz of `reconstruct`.")],
    out: Annotated[Path, typer.Option(help="What to write: .glb, .npz, .gif, .mp4, or a folder for PNG frames.")],
    resolution: Resolution = "medium",
    particles: Annotated[int | None, typer.Option(min=50, help="Lattice particles, about; 1,900 otherwise.")] = None,
    cell_size_m: Annotated[float | None, typer.Option(help="Edge of a lattice cell, metres, instead.")] = None,
    painting: Annotated[Path | None, typer.Option(help="What is painted on it: .npz by vertex, .toml by bone.")] = None,
    save_painting: Annotated[
        Path | None, typer.Option(help="Write how it is bound as a painting, .npz or .toml, to be painted over.")
    ] = None,
    examples: Annotated[
        Path | None, typer.Option(help="Example shapes, .toml; NAME.examples.toml beside the character otherwise.")
    ] = None,
    region_half_width: Annotated[int, typer.Option(min=1, max=5, help="How far flesh moves as one, cells.")] = 2,
    secondary: Annotated[bool, typer.Option(help="Let the flesh swing.")] = True,
    delta: Annotated[float, typer.Option(help="Share of the secondary motion, 0 to 0.95.")] = 0.6,
    frequency_hz: Annotated[float, typer.Option(help="Of the flesh's free swing, 0.5 to 12.")] = 4.5,
    damping_ratio: Annotated[float, typer.Option(help="0 swings on, 1 does not overshoot.")] = 0.3,
    gravity_m_s2: Annotated[float, typer.Option(min=0, max=20, help="A pull downwards beside the modelled one.")] = 0.0,
    volume: Annotated[bool, typer.Option(help="Keep the volume of each part.")] = True,
    fps: Annotated[float | None, typer.Option(min=1, max=240, help="Frames a second; the motion's own, or 30.")] = None,
    width: Annotated[int, typer.Option(min=64, max=7680, help="Of the pictures, pixels.")] = 960,
    height: Annotated[int, typer.Option(min=64, max=4320, help="Of the pictures, pixels.")] = 540,
    joint_names: JointNames = "ours",
) -> None:
    """Put a motion onto a character: mesh of the lattice in .npz and pictures, skin and animation in .glb.

    A .glb holds the skeleton, at most four weights a vertex and the motion; whoever plays it blends linearly. The
    volume's keeping and the flesh's swing are in the vertices of an .npz and in pictures.
    """
    from capture.characters import cast
    from capture.deforming import pictures, write_vertices
    from capture.export import read_npz, write_glb
    from capture.joint_presets import check_preset
    from capture.progress import progress_bar, tell_all
    from capture.video import write_frames, write_video
    from deformation.character import LatticeSettings, painting_of
    from deformation.deformer import Deformer, DeformSettings
    from deformation.painting import write_painting
    from deformation.secondary_motion import SecondarySettings
    from reconstruction.motion_files import read_motion
    from reconstruction.motion_operations import resampled

    ending = out.suffix.lower()
    if ending and ending not in _ENDINGS:
        raise choice_error("ending", ending, _ENDINGS)
    preset = check_preset(joint_names)
    (check_file_place if ending else check_folder_place)(out)
    if particles is not None and cell_size_m is not None:
        raise SettingError("--particles and --cell-size-m are both given: use one of them")
    swing = SecondarySettings(delta, frequency_hz, damping_ratio, (0.0, -gravity_m_s2, 0.0))
    settings = DeformSettings(volume, swing if secondary else None)
    clip = read_npz(motion) if motion.suffix.lower() == ".npz" else read_motion(motion)
    rate = fps or (clip.fps if ending in (".glb", ".npz") else min(clip.fps, 30.0))
    clip = resampled(clip, rate) if abs(rate - clip.fps) > 1e-6 else clip
    cells = LatticeSettings(cell_size_m, particles, region_half_width=region_half_width)
    chosen = cast(character, clip.skeleton, resolution, clip.pose(0), cells, examples, painting)
    tell_all(chosen.notes)
    body, clip = chosen.character, chosen.motion(clip)
    if save_painting is not None:
        write_painting(painting_of(body), body.skeleton, save_painting)
    if ending == ".glb":
        write_glb(body, clip, out, skin=chosen.skin, joint_names=preset)
    else:
        with progress_bar("loading kernels (compiled once, the first time)"):
            Deformer(body)
        with progress_bar("deforming") as progress:
            if ending == ".npz":
                write_vertices(body, clip, settings, out, progress)
            elif ending:
                write_video(pictures(chosen, clip, settings, (width, height), progress=progress), out, rate)
            else:
                write_frames(pictures(chosen, clip, settings, (width, height), progress=progress), out)
    print(f"{len(clip)} frames of {len(body.mesh.vertices)} vertices on {len(body.lattice.particles)} particles: {out}")
