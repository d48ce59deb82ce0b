"""`sixpoint rig` and `sixpoint inbetween`: a skeleton for a mesh, and shapes between two poses of it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from devices.errors import FileError, choice_error

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from deformation.auto_rig import AutoRig
    from deformation.mesh import Mesh


def rig(
    mesh: Annotated[Path, typer.Argument(help="The character: .obj, .ply, .glb or .vrm, upright, Y up.")],
    out: Annotated[Path, typer.Option(help="The skeleton to write, as JSON; a picture of it lands beside as .png.")],
    template: Annotated[str, typer.Option(help="auto, human or quadruped.")] = "auto",
    joints: Annotated[Path | None, typer.Option(help="Joints to move: a RIG.json, or a part of one.")] = None,
    unit_m: Annotated[float | None, typer.Option(help="What one unit of the file is, metres.")] = None,
    picture: Annotated[bool, typer.Option(help="Write the picture.")] = True,
) -> None:
    """Find the skeleton of a character mesh that has none.

    Iso-parametric curves of a quad mesh, or slices of a triangle mesh, give each limb's middle; joints lie where it
    bends, narrows or meets the body, and where a body's proportions put them. Joints have humanoid names. Saved beside
    its mesh as NAME.rig.json, the file makes NAME.obj a character for every command. Correct a joint by changing its
    `head` in the file and giving that to --joints.
    """
    from capture.raster import save_png
    from deformation.auto_rig import RigNotFound, RigSettings, rig_mesh, with_joints
    from deformation.auto_rig_file import read_joints, write_rig

    if out.parent != Path() and not out.parent.is_dir():
        raise FileError(f"{out}: the folder {out.parent} does not exist")
    body, unit, shift, notes = _placed(mesh, unit_m)
    try:
        found = rig_mesh(body, RigSettings(template))
    except RigNotFound as error:
        shown = out.with_suffix(".png")
        save_png(_picture(body, None, error.tips), shown)
        raise FileError(f"{mesh}: {error}; {shown} shows what was found") from None
    if joints is not None:
        found = with_joints(found, {name: place * unit + shift for name, place in read_joints(joints).items()})
    write_rig(found, out, unit, shift)
    if picture:
        save_png(_picture(body, found), out.with_suffix(".png"))
    for note in (*notes, *found.notes):
        print(note)
    print(f"{found.template} of {len(found.rig.skeleton)} joints in {len(body.vertices)} vertices: {out}")


def inbetween(
    poses: Annotated[list[Path], typer.Argument(help="Two or more poses of one mesh: .obj or .ply.")],
    frames: Annotated[int, typer.Option(min=1, max=1000, help="Shapes between each pose and the next.")] = 8,
    out: Annotated[Path, typer.Option(help="A folder for .obj files, or an .npz of vertices.")] = Path("inbetween"),
    duration_s: Annotated[float, typer.Option(min=0.01, help="From one pose to the next, seconds.")] = 0.5,
    young_modulus_pa: Annotated[float, typer.Option(help="Of the skin, pascal.")] = 2e5,
    density_kg_m3: Annotated[float, typer.Option(help="Of the skin.")] = 1100.0,
    thickness_m: Annotated[float, typer.Option(help="Of the skin with what hangs on it, metres.")] = 0.01,
    frequency_hz: Annotated[float, typer.Option(help="Of the skin's swing on the flesh.")] = 4.0,
    damping_ratio: Annotated[float, typer.Option(help="0 swings on, 1 does not overshoot.")] = 0.35,
) -> None:
    """Make the shapes between poses of one mesh, its skin bending as beams along its curves.

    The first shape is the first pose and every pose is met exactly. All files must have the same vertices in the same
    order.
    """
    from capture.progress import progress_bar
    from deformation.beam import BeamSettings
    from deformation.inbetween import inbetween as shapes_between
    from deformation.inbetween_files import write_shapes
    from deformation.mesh_files import read_mesh

    if out.suffix.lower() not in ("", ".npz"):
        raise choice_error("ending", out.suffix, (".npz", "a folder for .obj files"))
    if out.parent != Path() and not out.parent.is_dir():
        raise FileError(f"{out}: the folder {out.parent} does not exist")
    settings = BeamSettings(young_modulus_pa, density_kg_m3, thickness_m, frequency_hz, damping_ratio)
    meshes = [read_mesh(path) for path in poses]
    for path, mesh in zip(poses, meshes, strict=True):
        if mesh.vertices.shape != meshes[0].vertices.shape:
            raise FileError(
                f"{path}: {len(mesh.vertices)} vertices where {poses[0]} has {len(meshes[0].vertices)}: "
                "use poses of the same mesh"
            )
    with progress_bar("bending") as progress:
        shapes = shapes_between(meshes[0], [m.vertices for m in meshes], frames, duration_s, settings, progress)
        count = write_shapes(meshes[0], shapes, out)
    print(f"{count} shapes of {len(meshes[0].vertices)} vertices: {out}")


def _placed(path: Path, unit_m: float | None) -> tuple["Mesh", float, "NDArray[np.float64]", tuple[str, ...]]:
    """The mesh in metres on the floor, the unit and shift (3,) that put it there, and lines on what was mended."""
    import numpy as np

    from deformation.character_files import read_character
    from deformation.mesh_files import read_mesh
    from deformation.mesh_repair import in_metres, repaired

    if path.suffix.lower() in (".glb", ".gltf", ".vrm"):
        file = read_character(path, unit_m)
        return file.mesh, 1.0, np.zeros(3), file.notes
    raw = read_mesh(path)
    unit, note = (unit_m, None) if unit_m is not None else in_metres(raw.vertices, path.name)
    mended = repaired(raw.with_vertices(raw.vertices * unit), path.name)
    shift = np.array([0.0, -mended.mesh.vertices[:, 1].min(), 0.0])
    notes = (*([note] if note else []), *mended.notes)
    return mended.mesh.with_vertices(mended.mesh.vertices + shift), unit, shift, notes


def _picture(mesh: "Mesh", found: "AutoRig | None", tips: "NDArray[np.float64] | None" = None) -> "NDArray[np.uint8]":
    """(H, W, 3) sRGB: the mesh from before and from its left, rings, centre lines and skeleton in it."""
    import numpy as np

    from capture.raster import contact_sheet, render
    from capture.scene import Camera, Lines, Scene, Spheres, Surface, skeleton_marks

    scale = 1.75 / float(np.ptp(mesh.vertices[:, 1]))
    skin = Surface(mesh.vertices * scale, mesh.triangulated, opacity=0.55)
    lines: list[Lines] = []
    balls: list[Spheres] = []
    if tips is not None:
        balls.append(Spheres(tips * scale, 0.03, (0.85, 0.22, 0.20), through=0.8))
    if found is not None:
        lines += _curve_lines(mesh, found, scale)
        bones, joints = skeleton_marks(found.rig.skeleton, found.rig.bind[:, :3, 3] * scale)
        lines.append(bones)
        balls.append(joints)
    views = [Scene((skin,), tuple(lines), tuple(balls), Camera(yaw=yaw)).framed(1.0) for yaw in (0.35, 1.45)]
    return contact_sheet([render(view, 640, 640) for view in views], 2)


def _curve_lines(mesh: "Mesh", found: "AutoRig", scale: float) -> list:
    """The rings of the tubes, faint, and the limbs' middles."""
    import numpy as np

    from capture.scene import Lines

    parts = []
    if found.curves is not None and found.tubes is not None and len(found.tubes.curves):
        rings = [found.curves.curve(int(number)) for number in found.tubes.curves]
        segments = np.concatenate([np.stack([ring, np.roll(ring, -1)], axis=1) for ring in rings])
        parts.append(Lines(mesh.vertices * scale, segments, (0.16, 0.52, 0.66), width=0.8, opacity=0.5))
    for line in found.lines.values():
        steps = np.arange(len(line.points) - 1)
        segments = np.stack([steps, steps + 1], axis=1).astype(np.int32)
        parts.append(Lines(line.points * scale, segments, (0.2, 0.45, 0.9), width=1.6, through=0.5))
    return parts
