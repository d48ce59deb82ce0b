"""Joint names as other programs expect them: what a motion's joints are called in the files it is written to.

The tables are data: Mixamo's download skeleton, Autodesk HumanIK's naming template (MotionBuilder), the CMU database's
own skeleton, and the bones of Blender's Rigify human meta-rig.
"""

from collections.abc import Mapping
from dataclasses import replace

from devices.errors import choice_error
from reconstruction.motion import Motion
from reconstruction.skeleton import Skeleton

_AUTODESK = {
    "hips": "Hips",
    "spine": "Spine",
    "chest": "Spine1",
    "upper_chest": "Spine2",
    "neck": "Neck",
    "head": "Head",
    "shoulder": "{Side}Shoulder",
    "upper_arm": "{Side}Arm",
    "lower_arm": "{Side}ForeArm",
    "hand": "{Side}Hand",
    "upper_leg": "{Side}UpLeg",
    "lower_leg": "{Side}Leg",
    "foot": "{Side}Foot",
    "toes": "{Side}ToeBase",
}
_RIGIFY = {
    "hips": "spine",
    "spine": "spine.001",
    "chest": "spine.002",
    "upper_chest": "spine.003",
    "neck": "spine.004",
    "head": "spine.006",
    "shoulder": "shoulder.{S}",
    "upper_arm": "upper_arm.{S}",
    "lower_arm": "forearm.{S}",
    "hand": "hand.{S}",
    "upper_leg": "thigh.{S}",
    "lower_leg": "shin.{S}",
    "foot": "foot.{S}",
    "toes": "toe.{S}",
}

PRESETS: Mapping[str, Mapping[str, str]] = {
    "blender": _RIGIFY,
    "cmu": _AUTODESK | {"spine": "LowerBack", "chest": "Spine", "upper_chest": "Spine1"},
    "mixamo": {bone: f"mixamorig:{name}" for bone, name in _AUTODESK.items()},
    "motionbuilder": _AUTODESK,
}
"""Joint name by humanoid bone; `{Side}` stands for Left or Right, `{S}` for L or R."""

OURS = "ours"
"""The name that stands for a motion's own joint names."""


def check_preset(name: str) -> str | None:
    """The preset, None for `ours`. Raises SettingError for one that is not there."""
    if name != OURS and name not in PRESETS:
        raise choice_error("joint names", name, (OURS, *PRESETS))
    return None if name == OURS else name


def renamed(motion: Motion, preset: str) -> Motion:
    """The same motion with its humanoid joints called as in `PRESETS[preset]`; joints no preset knows keep their names.

    A name that would then be there twice gets a number. Raises SettingError for an unknown preset.
    """
    return replace(motion, skeleton=renamed_skeleton(motion.skeleton, preset))


def renamed_skeleton(skeleton: Skeleton, preset: str) -> Skeleton:
    """`renamed` for a skeleton alone."""
    if preset not in PRESETS:
        raise choice_error("joint names", preset, PRESETS)
    table = PRESETS[preset]
    named = {joint: _name(bone, table) for bone, joint in skeleton.humanoid.items()}
    taken, names = set(named.values()), []
    for joint, own in enumerate(skeleton.names):
        if joint in named:
            names.append(named[joint])
            continue
        parent = int(skeleton.parents[joint])
        is_tip = parent >= 0 and own == f"{skeleton.names[parent]}_end"
        names.append(_free(f"{names[parent]}_end" if is_tip else own, taken))
        taken.add(names[-1])
    return replace(skeleton, names=tuple(names))


def _name(bone: str, table: Mapping[str, str]) -> str:
    side, _, part = bone.partition("_")
    if side not in ("left", "right"):
        return table[bone]
    return table[part].format(Side=side.capitalize(), S=side[0].upper())


def _free(name: str, taken: set[str]) -> str:
    number = 2
    free = name
    while free in taken:
        free = f"{name}_{number}"
        number += 1
    return free
