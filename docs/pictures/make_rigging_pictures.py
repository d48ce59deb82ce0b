"""Makes the pictures of docs/rigging.md: `python docs/pictures/make_rigging_pictures.py [FOLDER]`.

Without a folder they go into docs/pictures. All of them show the mannequin, so that nothing but the package is needed.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from capture.raster import contact_sheet, render
from capture.rig_view import RigView, rig_picture
from capture.scene import Camera, Scene, Surface
from deformation.auto_rig import RigSettings, rig_mesh
from deformation.character import Character, mannequin_character
from deformation.deformer import Deformer, DeformSettings
from deformation.example_files import posed, with_examples
from deformation.inbetween import ease, inbetween
from deformation.inbetween_files import write_shapes
from deformation.mesh import Mesh, all_quads, volume
from deformation.skinning import bind_points, joint_motion, linear_blend
from deformation.surface import normals_reference
from reconstruction.standard_body import standard_skeleton

_BEND = {"left_lower_arm": (0, -109, 0), "left_upper_leg": (-75, 0, 0), "left_lower_leg": (92, 0, 0)}
"""Degrees about the axes of the bind pose: what the compared poses bend."""

_ELBOW = np.array([0.0, -100.0, 0.0])


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent)
    character = mannequin_character(standard_skeleton(), "medium")
    found = rig_mesh(character.mesh)
    save(rig_picture(RigView(character.mesh, found)), folder / "rig_mannequin.png")
    hand = hand_of(character)
    fingers = RigView(hand, rig_mesh(hand, RigSettings("hand")))
    save(rig_picture(fingers, (0.4, 1.6, 3.2), 480), folder / "rig_hand.png")
    save(compared(character), folder / "inbetween_compared.png", 0.5)
    save(elbows(character), folder / "pose_examples.png")


def save(image: NDArray[np.uint8], path: Path, scale: float = 1.0) -> None:
    """Writes a picture, smaller by `scale`, with few colours."""
    picture = Image.fromarray(image)
    picture = picture.resize((round(picture.width * scale), round(picture.height * scale)), Image.Resampling.LANCZOS)
    picture.quantize(200, dither=Image.Dither.NONE).save(path, optimize=True)
    print(path)


def hand_of(character: Character) -> Mesh:
    """The mannequin's left hand by itself, pointing up."""
    bones, places = character.skeleton.humanoid, character.bind[:, :3, 3]
    wrist, elbow = places[bones["left_hand"]], places[bones["left_lower_arm"]]
    along = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    away = character.mesh.vertices - wrist
    own = (away @ along > -0.03) & (np.linalg.norm(away, axis=1) < 0.3)
    quads = character.mesh.quads[own[character.mesh.quads].all(axis=1)]
    used = np.unique(quads)
    turn = Rotation.align_vectors([[0, 1, 0], [0, 0, 1]], [along, [0, 0, 1]], weights=[1.0, 0.1])[0].as_matrix()
    vertices = away[used] @ turn.T
    return all_quads(vertices - [0, vertices[:, 1].min(), 0], np.searchsorted(used, quads).astype(np.int32))


def in_pose(character: Character, share: float) -> NDArray[np.float64]:
    """`T_world_joint` (J, 4, 4) so far into the compared bend."""
    bones = character.skeleton.humanoid
    return posed(character, {bones[bone]: share * np.radians(turn) for bone, turn in _BEND.items()})


def compared(character: Character) -> NDArray[np.uint8]:
    """Beams between two poses beside linear blend and dual quaternions (fig. 10), and what they do to the volume."""
    mesh, steps = character.mesh, 4
    end = Deformer(character, DeformSettings(secondary=None)).deform(in_pose(character, 1.0)).vertices.copy()
    positions = np.ascontiguousarray(character.bind[:, :3, 3])
    binding = bind_points(character.skeleton, positions, character.vertex_joints, character.vertex_weights)
    motions = [
        joint_motion(in_pose(character, ease(step / steps)), character.bind_inverse) for step in range(steps + 1)
    ]
    joints, weights = binding.joints, binding.weights
    rows = {
        "beams": list(inbetween(mesh, [mesh.vertices, end], steps - 1)),
        "linear blend": [linear_blend(motion, binding, mesh.vertices) for motion in motions],
        "dual quaternions": [dual_quaternions(motion, joints, weights, mesh.vertices) for motion in motions],
    }
    for name, shapes in rows.items():
        change = [100 * (volume(mesh.with_vertices(shape)) / volume(mesh) - 1) for shape in shapes]
        print(name, "volume", " ".join(f"{value:+.2f} %" for value in change))
    camera = Camera(target=(0.15, 0.85, 0.1), distance=3.6, yaw=0.75)
    return sheet(
        mesh, [(f"{name} {n}/{steps}", s) for name, shapes in rows.items() for n, s in enumerate(shapes)], camera, 5
    )


def dual_quaternions(
    motion: NDArray[np.float64], joints: NDArray[np.int32], weights: NDArray[np.float64], rest: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (N, 3) by dual quaternion skinning (Kavan et al. 2008); motion: (J, 3, 4)."""
    real = Rotation.from_matrix(motion[:, :, :3]).as_quat()
    dual = 0.5 * product(np.pad(motion[:, :, 3], ((0, 0), (0, 1))), real)
    sign = np.where(np.einsum("nki,ni->nk", real[joints], real[joints[:, 0]]) < 0, -1.0, 1.0)
    r, d = (np.einsum("nk,nki->ni", weights * sign, part[joints]) for part in (real, dual))
    size = np.linalg.norm(r, axis=1, keepdims=True)
    r, d = r / size, d / size
    return Rotation.from_quat(r).apply(np.array(rest)) + 2 * product(d, r * [-1, -1, -1, 1])[:, :3]


def product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 4) of quaternions (x, y, z, w)."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    return np.concatenate([vector, a[:, 3:] * b[:, 3:] - (a[:, :3] * b[:, :3]).sum(axis=1, keepdims=True)], axis=1)


def elbows(character: Character) -> NDArray[np.uint8]:
    """An elbow at rising angles, plain and with an example shape whose biceps swells."""
    wearing = with_example(character)
    pictures = []
    for name, worn in (("plain", character), ("with its example", wearing)):
        deformer = Deformer(worn, DeformSettings(secondary=None))
        elbow = character.skeleton.humanoid["left_lower_arm"]
        for share in (0.0, 0.5, 1.0):
            deformer.reset()
            shape = deformer.deform(posed(character, {elbow: share * np.radians(_ELBOW)})).vertices.copy()
            pictures.append((f"{name}, {share * np.linalg.norm(_ELBOW):.0f} degrees", shape))
    return sheet(character.mesh, pictures, Camera(target=(0.38, 1.22, 0.02), distance=1.25, yaw=0.5, pitch=0.25), 3)


def with_example(character: Character) -> Character:
    """The mannequin with one example shape, by way of its files."""
    bones, places = character.skeleton.humanoid, character.bind[:, :3, 3]
    elbow = bones["left_lower_arm"]
    bent = Deformer(character, DeformSettings(secondary=None)).deform(posed(character, {elbow: np.radians(_ELBOW)}))
    middle = (places[bones["left_upper_arm"]] * 0.4 + places[elbow] * 0.6) + [0, 0.015, 0.045]
    near = np.exp(-((np.linalg.norm(character.mesh.vertices - middle, axis=1) / 0.05) ** 2))
    normals = normals_reference(character.mesh, bent.vertices)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_shapes(character.mesh, [bent.vertices + 0.022 * near[:, None] * normals], folder / "bent")
        (folder / "mannequin.examples.toml").write_text(
            'format = "sixpoint-examples 1"\n\n[[example]]\nmesh = "bent/0000.obj"\njoint = "left_lower_arm"\n'
            f"turn_deg = {_ELBOW.tolist()}\n"
        )
        return with_examples(character, folder / "mannequin.examples.toml")


def sheet(
    mesh: Mesh, shapes: Sequence[tuple[str, NDArray[np.float64]]], camera: Camera, columns: int
) -> NDArray[np.uint8]:
    """A picture of each shape (V, 3) under its title."""
    scenes = [Scene((Surface(shape, mesh.triangulated),), (), (), camera, title=title) for title, shape in shapes]
    return contact_sheet([render(scene, 420, 520) for scene in scenes], columns)


if __name__ == "__main__":
    main()
