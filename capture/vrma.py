"""VRM animation (.vrma): a motion that any VRM character can play, whoever it was captured from.

A GLB of nodes and one animation, with the extension `VRMC_vrm_animation` 1.0 (vrm-c/vrm-specification) saying which
node is which humanoid bone. At rest the nodes stand in VRM's T-pose; only the hips are moved, all others turned.
"""

from pathlib import Path

from capture.glb import GlbBuffer, animation_of
from capture.vrm_pose import vrm_motion
from devices.errors import SettingError
from reconstruction.motion import Motion, Pose
from replay_logs.atomic_file import written_beside

_LIMBS = ("UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot")
REQUIRED = ("hips", "spine", "head", *(f"{side}{bone}" for side in ("left", "right") for bone in _LIMBS))
"""The bones that VRM does not do without."""


def write_vrma(motion: Motion, path: str | Path, reference: Pose | None = None) -> None:
    """Writes the motion, beside `path` and renamed into place.

    reference: a pose that stands, for skeletons whose rest pose is none; the motion's first where None. Raises
    SettingError where the skeleton lacks a bone that VRM needs, OSError.
    """
    from pygltflib import GLTF2, Asset, Buffer, Node, Scene

    normal = vrm_motion(motion, reference or motion.pose(0))
    names, children = normal.skeleton.names, normal.skeleton.children
    missing = [name for name in REQUIRED if name not in names]
    if missing:
        raise SettingError(f"{path}: a VRM animation needs the bones {', '.join(missing)}, which {motion.name!r} lacks")
    gltf = GLTF2(asset=Asset(version="2.0", generator="sixpoint"), scene=0, scenes=[Scene(nodes=[0])])
    buffer = GlbBuffer(gltf)
    gltf.nodes = [
        Node(name=name, translation=offset, children=list(below) or None)
        for name, offset, below in zip(names, normal.skeleton.offsets.tolist(), children, strict=True)
    ]
    gltf.animations = [animation_of(normal, buffer)]
    bones = {name: {"node": number} for number, name in enumerate(names)}
    gltf.extensionsUsed = ["VRMC_vrm_animation"]
    gltf.extensions = {"VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}}
    gltf.buffers = [Buffer(byteLength=len(buffer.data))]
    gltf.set_binary_blob(bytes(buffer.data))
    with written_beside(Path(path)) as part:
        part.write_bytes(b"".join(gltf.save_to_bytes()))
