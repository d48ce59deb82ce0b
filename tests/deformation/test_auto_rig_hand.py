"""Fingers: of a body's hands and of hands alone, named, on the right side, and carried along by the hand."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from deformation.auto_rig import AutoRig, RigNotFound, RigSettings, rig_mesh
from deformation.character_files import read_character
from deformation.mannequin import mannequin
from deformation.mesh import Mesh, all_quads
from deformation.retarget import Retargeter
from deformation.rig_templates import FINGER_NAMES, HAND_TREES, finger_tree
from reconstruction.kinematics import world_transforms
from reconstruction.motion import Pose
from reconstruction.standard_body import standard_skeleton
from tests.deformation.test_isocurves import cylinder

SHARED = Path(__file__).parents[2] / ".." / "shared" / "meshes"


@pytest.fixture(scope="module")
def body() -> tuple[Mesh, np.ndarray]:
    return mannequin(standard_skeleton(), "medium")


@pytest.fixture(scope="module")
def found(body) -> AutoRig:
    return rig_mesh(body[0])


def places(found: AutoRig) -> dict[str, np.ndarray]:
    return dict(zip(found.rig.skeleton.names, found.rig.bind[:, :3, 3], strict=True))


def hand_alone(body: tuple[Mesh, np.ndarray], side: str) -> tuple[Mesh, np.ndarray]:
    """The mannequin's hand, open at the forearm and turned anyhow, and its wrist (3,)."""
    mesh, bind = body
    bones = standard_skeleton().humanoid
    wrist, elbow = (bind[bones[f"{side}_{bone}"], :3, 3] for bone in ("hand", "lower_arm"))
    along = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    away = mesh.vertices - wrist
    own = (away @ along > -0.04) & (np.linalg.norm(away, axis=1) < 0.3)
    quads = mesh.quads[own[mesh.quads].all(axis=1)]
    used = np.unique(quads)
    turn = Rotation.from_euler("xyz", [40, 70, 110], degrees=True).as_matrix().T
    return all_quads(mesh.vertices[used] @ turn, np.searchsorted(used, quads).astype(np.int32)), wrist @ turn


def test_a_body_has_ten_fingers(found: AutoRig) -> None:
    at = places(found)
    for side, sign in (("left", 1), ("right", -1)):
        assert {name for name, _ in finger_tree(side)} <= at.keys()
        tips = np.array([at[f"{side}_{finger}_distal_end"] for finger in FINGER_NAMES])
        # The mannequin's thumbs are in front, its little fingers behind.
        assert tips[0, 2] > tips[1, 2] > tips[4, 2]
        for finger in FINGER_NAMES[1:]:
            chain = [at[f"{side}_hand"], *(at[f"{side}_{finger}_{p}"] for p in ("proximal", "intermediate", "distal"))]
            heights = [point[1] for point in chain]
            assert heights == sorted(heights, reverse=True)
            assert sign * chain[1][0] > 0


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("template", ["hand", "auto"])
def test_a_hand_alone_knows_its_side(body, side: str, template: str) -> None:
    mesh, wrist = hand_alone(body, side)
    found = rig_mesh(mesh, RigSettings(template))
    assert found.template == "hand"
    assert found.rig.skeleton.names == tuple(name for name, _ in HAND_TREES[side])
    assert np.linalg.norm(places(found)[f"{side}_hand"] - wrist) < 0.035


def test_fingers_follow_the_hand(found: AutoRig) -> None:
    performer, skeleton = standard_skeleton(), found.rig.skeleton
    retargeter = Retargeter(performer, skeleton, target_bind=found.rig.bind)
    turns = np.tile([0.0, 0, 0, 1.0], (len(performer), 1))
    turns[performer.humanoid["left_hand"]] = Rotation.from_euler("z", 40, degrees=True).as_quat()
    posed = retargeter.pose(Pose(0.0, np.array([0, 1.0, 0]), turns))
    joints = world_transforms(skeleton, posed.root_position, posed.rotations)
    hand = skeleton.names.index("left_hand")
    before = np.linalg.inv(found.rig.bind[hand]) @ found.rig.bind
    after = np.linalg.inv(joints[hand]) @ joints
    fingers = [n for n, name in enumerate(skeleton.names) if name.startswith("left_") and "_distal" in name]
    assert len(fingers) == 10
    np.testing.assert_allclose(after[fingers], before[fingers], atol=1e-9)


def test_what_has_no_fingers_is_no_hand() -> None:
    with pytest.raises(RigNotFound, match="fewer than three fingers"):
        rig_mesh(cylinder(12, 30), RigSettings("hand"))


@pytest.mark.skipif(not SHARED.is_dir(), reason="no folder of shared meshes beside the repository")
def test_the_fingers_of_another_make() -> None:
    file = read_character(SHARED / "human-male.glb")
    assert file.rig is not None
    truth = dict(zip(file.rig.skeleton.names, file.rig.bind[:, :3, 3], strict=True))
    found = places(rig_mesh(file.mesh))
    off = []
    for ours, theirs in zip(FINGER_NAMES, ("thumb", "index", "middle", "ring", "pinky"), strict=True):
        parts = ("metacarpal", "proximal", "distal") if ours == "thumb" else ("proximal", "intermediate", "distal")
        for side in ("left", "right"):
            for number, part in enumerate(parts, start=1):
                off.append(np.linalg.norm(found[f"{side}_{ours}_{part}"] - truth[f"{theirs}_0{number}_{side[0]}"]))
    assert np.mean(off) < 0.03


def test_a_body_is_no_hand_for_having_five_limbs(body) -> None:
    mesh = body[0]
    upside_down = mesh.with_vertices(mesh.vertices * [1, -1, 1])
    with pytest.raises(RigNotFound, match=r"no person|not parted|stand clear"):
        rig_mesh(upside_down)
