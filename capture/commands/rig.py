"""`sixpoint rig` and `sixpoint inbetween`: a skeleton for a mesh, and shapes between two poses of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from devices.errors import FileError, SixpointError, choice_error
from replay_logs.atomic_file import check_file_place, check_folder_place

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from capture.rig_view import RigView
    from deformation.character_files import Placement
    from deformation.mesh import Mesh


@dataclass(frozen=True, eq=False)
class _PlacedMesh:
    """A mesh in metres on the floor. What is at x metres is at (x - shift) / unit_m in the file, or in metres of a GLB.

    placement: what was done to the file's vertices; notes: lines on what was mended.
    """

    mesh: "Mesh"
    unit_m: float
    shift: "NDArray[np.float64]"
    placement: "Placement"
    notes: tuple[str, ...]


def rig(
    meshes: Annotated[
        list[Path],
        typer.Argument(
            metavar="MESH...", help="The character: .obj, .ply, .glb or .vrm, upright, Y up; more poses of it."
        ),
    ],
    out: Annotated[Path, typer.Option(help="The skeleton to write, as JSON; a picture of it lands beside as .png.")],
    template: Annotated[str, typer.Option(help="auto, human, quadruped or hand.")] = "auto",
    joints: Annotated[Path | None, typer.Option(help="Joints to move: a RIG.json, or a part of one.")] = None,
    unit_m: Annotated[float | None, typer.Option(help="What one unit of the file is, metres.")] = None,
    picture: Annotated[bool, typer.Option(help="Write the picture.")] = True,
    show: Annotated[bool, typer.Option("--show", help="Show it in a window too, or why there is no skeleton.")] = False,
    curves: Annotated[
        str, typer.Option(help="edges: along the quads' edges; rays: by the paper's ray test.")
    ] = "edges",
    matching: Annotated[
        str, typer.Option(help="A person's joints: anatomy, or the paper's midpoint or triangle form.")
    ] = "anatomy",
) -> None:
    """Find the skeleton of a character mesh that has none.

    Iso-parametric curves of a quad mesh, or slices of a triangle mesh, give each limb's middle; joints lie where it
    bends, narrows or meets the body, and where a body's proportions put them. Joints have humanoid names. Saved beside
    its mesh as NAME.rig.json, the file makes NAME.obj a character for every command. Given further poses of the same
    mesh, each joint is taken from the pose that bends it most. Correct a joint by changing its `head` in the file and
    giving that to --joints.
    """
    from capture.raster import save_png
    from capture.rig_view import RigView, rig_picture
    from deformation.auto_rig import RigNotFound, RigSettings, with_joints
    from deformation.auto_rig_file import read_joints, write_rig
    from deformation.auto_rig_poses import rig_poses

    settings = RigSettings(template, curves, matching)
    check_file_place(out)
    if show:
        _check_display()
    mesh = meshes[0]
    # What unit a file is in is guessed by a person's height; a hand tells nothing of it.
    file = _placed(mesh, 1.0 if template == "hand" and unit_m is None else unit_m)
    poses = [file.mesh, *(_pose(path, file, mesh) for path in meshes[1:])]
    try:
        found = rig_poses(poses, settings)
    except RigNotFound as error:
        shown, view = out.with_suffix(".png"), RigView(file.mesh, None, error.tips, f"{mesh.name}: {error}")
        save_png(rig_picture(view), shown)
        if show:
            _show(view)
        raise FileError(f"{mesh}: {error}; {shown} shows what was found") from None
    if joints is not None:
        moved = {name: place * file.unit_m + file.shift for name, place in read_joints(joints).items()}
        found = with_joints(found, moved)
    write_rig(found, out, file.unit_m, file.shift)
    view = RigView(file.mesh, found, title=mesh.name)
    if picture:
        save_png(rig_picture(view), out.with_suffix(".png"))
    for note in (*file.notes, *found.notes):
        print(note)
    print(f"{found.template} of {len(found.rig.skeleton)} joints in {len(file.mesh.vertices)} vertices: {out}")
    if show:
        _show(view)


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
    (check_file_place if out.suffix else check_folder_place)(out)
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


def _placed(path: Path, unit_m: float | None) -> "_PlacedMesh":
    """The mesh in metres on the floor, as the file has it turned."""
    import numpy as np

    from deformation.character_files import Placement, read_character
    from deformation.mesh_files import read_mesh
    from deformation.mesh_repair import in_metres, repaired

    if path.suffix.lower() in (".glb", ".gltf", ".vrm"):
        file = read_character(path, unit_m)
        assert file.placement is not None
        return _PlacedMesh(file.mesh, 1.0, np.zeros(3), file.placement, file.notes)
    raw = read_mesh(path)
    unit, note = (unit_m, None) if unit_m is not None else in_metres(raw.vertices, path.name)
    mended = repaired(raw.with_vertices(raw.vertices * unit), path.name)
    shift = np.array([0.0, -mended.mesh.vertices[:, 1].min(), 0.0])
    placement = Placement(len(raw.vertices), np.eye(3) * unit, mended.kept, shift)
    mesh = mended.mesh.with_vertices(mended.mesh.vertices + shift)
    return _PlacedMesh(mesh, unit, shift, placement, (*([note] if note else []), *mended.notes))


def _pose(path: Path, file: "_PlacedMesh", first: Path) -> "Mesh":
    """Another pose of the mesh, on the floor by itself."""
    from deformation.mesh_files import read_mesh

    vertices = read_mesh(path).vertices
    if len(vertices) != file.placement.count:
        raise FileError(
            f"{path}: {len(vertices)} vertices where {first} has {file.placement.count}: use poses of the same mesh"
        )
    placed = file.placement.placed(vertices)
    return file.mesh.with_vertices(placed - [0.0, placed[:, 1].min(), 0.0])


def _check_display() -> None:
    from capture.viewer import has_display

    if not has_display():
        raise SixpointError("no display here for --show; the picture beside the RIG.json shows the same")


def _show(view: "RigView") -> None:
    from capture.viewer import show as show_window
    from capture.viewing import Layers

    show_window(view, title=f"sixpoint rig: {view.title}", layers=Layers(skeleton=True, curves=True))
