"""One vocabulary for joints: the humanoid bones as the VRM specification names them, and the names others use.

The tables are data. A name is compared without case, separators and a `mixamorig:`-like prefix.
"""

import re
from collections.abc import Sequence

HUMANOID_OF_ROLE = {
    "root": "hips",
    "head": "head",
    "left_wrist": "left_hand",
    "right_wrist": "right_hand",
    "left_ankle": "left_foot",
    "right_ankle": "right_foot",
}
"""The humanoid bone at whose joint each tracker role sits."""

_CENTRE = {
    "hips": ("hips", "hip", "pelvis", "root"),
    "spine": ("lowerback", "spine", "spine1", "spine01", "spine05"),
    "chest": ("spine", "chest", "spine1", "spine2", "spine02", "spine03", "upperback", "thorax"),
    "upper_chest": ("spine1", "upperchest", "spine2", "spine3", "thorax", "spine01", "spine03"),
    "neck": ("neck1", "neck", "neck01", "lowerneck", "upperneck", "spine004"),
    "head": ("head", "spine006"),
}
"""Names from the hips up, in order of preference; a name is given to one bone only, lowest bone first."""

_SIDED = {
    "shoulder": ("shoulder", "clavicle", "clavicle01", "collar", "collarbone"),
    "upper_arm": ("arm", "upperarm", "upperarm01", "humerus", "uparm"),
    "lower_arm": ("forearm", "lowarm", "lowerarm", "lowerarm01", "radius", "elbow"),
    "hand": ("wrist", "hand"),
    "upper_leg": ("upleg", "upperleg", "upperleg01", "femur", "thigh"),
    "lower_leg": ("leg", "lowleg", "lowerleg", "lowerleg01", "tibia", "shin", "calf", "knee"),
    "foot": ("foot", "ankle"),
    "toes": ("toebase", "toes", "toe", "ball", "toe11", "toe0"),
}

CENTRE_BONES = tuple(_CENTRE)
SIDED_BONES = tuple(_SIDED)


_PREFIX = re.compile(r"^(mixamorig\d*|jbipc?|bip0*1|def|ccbase|valvebipedbip0*1|character\d*)(?=[a-z])")
"""What Mixamo, VRoid, 3ds Max, Rigify, Character Creator and Source put before every joint's name."""


def plain_name(name: str) -> str:
    """`mixamorig:LeftUpLeg`, `left_up-leg` and `LeftUpLeg` all become `leftupleg`."""
    plain = re.sub(r"[^a-z0-9]", "", name.split(":")[-1].lower())
    return _PREFIX.sub("", plain)


def humanoid_names(names: Sequence[str]) -> dict[str, int]:
    """Index by humanoid bone name for each joint name that the tables know; end sites are left out."""
    index = {plain_name(n): i for i, n in reversed(list(enumerate(names))) if not n.endswith("_end")}
    found: dict[str, int] = {}
    taken: set[str] = set()
    for bone, aliases in _CENTRE.items():
        for alias in aliases:
            if alias in index and alias not in taken:
                found[bone] = index[alias]
                taken.add(alias)
                break
    for bone, aliases in _SIDED.items():
        for side in ("left", "right"):
            for alias in (form for a in aliases for form in _sided_forms(side, a)):
                if alias in index:
                    found[f"{side}_{bone}"] = index[alias]
                    break
    return found


def _sided_forms(side: str, alias: str) -> tuple[str, ...]:
    letter = side[0]
    return (side + alias, alias + side, letter + alias, alias + letter)
