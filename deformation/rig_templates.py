"""What is known of a character before it is seen: joints, their order, and the proportions that no curve shows.

Human figures are those of Drillis and Contini (1966) as printed in Winter, Biomechanics and Motor Control of Human
Movement, and of Gordon et al., 2012 Anthropometric Survey of U.S. Army Personnel (heights of the crotch, acromion,
suprasternale and cervicale). The hand's are of Buchholz, Armstrong and Goldstein (1992), shares of its length.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise


@dataclass(frozen=True)
class HumanTemplate:
    """Shares of lengths that the mesh gives; see `auto_rig_human` for which cue each joins.

    hip_between: hip joint's height from crotch to shoulder; hip_to_shoulder, hip_to_stature: from the floor to those.
    knee, elbow: along hip-ankle and shoulder-wrist. hand: wrist to finger tip along the arm; arm (shoulder to
    finger tip), ankle_height: of stature.
    neck_to_waist, neck_to_crown: height of the neck's base, midway of suprasternale and cervicale, from the shoulders
    to where the neck is narrowest and to the crown.
    spine: along hips-neck; clavicle: along breast bone-shoulder; head: along neck-crown; toes: along ankle-toe tip.
    """

    hip_between: float = 0.16
    hip_to_shoulder: float = 0.636
    hip_to_stature: float = 0.525
    knee: float = 0.489
    elbow: float = 0.56
    hand: float = 0.245
    arm: float = 0.44
    ankle_height: float = 0.039
    spine: tuple[float, float, float] = (0.18, 0.41, 0.67)
    clavicle: float = 0.155
    head: float = 0.333
    toes: float = 0.67
    neck_to_waist: float = 0.604
    neck_to_crown: float = 0.215


HUMAN = HumanTemplate()

Tree = tuple[tuple[str, str | None], ...]
"""Joints and their parents, under the VRM specification's names; a parent stands before its children."""

_TRUNK = ("hips", "spine", "chest", "upper_chest", "neck", "head", "head_end")
_ARM = ("upper_chest", "shoulder", "upper_arm", "lower_arm", "hand", "hand_end")
_LEG = ("hips", "upper_leg", "lower_leg", "foot")


def _body_tree(*toes: str) -> Tree:
    """A trunk with its limbs; toes: what follows each foot, outwards."""
    return (
        (_TRUNK[0], None),
        *_outwards(_TRUNK),
        *(
            (f"{side}_{joint}", parent if parent in _TRUNK else f"{side}_{parent}")
            for side in ("left", "right")
            for joint, parent in (*_outwards(_ARM), *_outwards((*_LEG, *toes)))
        ),
    )


def _outwards(chain: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Each joint of a chain, but for the first, with the one before it."""
    return tuple((joint, parent) for parent, joint in pairwise(chain))


HUMAN_TREE = _body_tree("toes", "toes_end")


FINGER_NAMES = ("thumb", "index", "middle", "ring", "little")


@dataclass(frozen=True)
class HandTemplate:
    """Shares of a hand's length, from the wrist to the tip of the middle finger.

    phalanges: of a long finger, from the knuckle outwards, the mean of four; thumb: metacarpal and two phalanges.
    under_web: how much of the first phalanx lies under the web between the fingers.
    """

    phalanges: tuple[float, float, float] = (0.240, 0.149, 0.101)
    thumb: tuple[float, float, float] = (0.251, 0.196, 0.158)
    under_web: float = 0.45


HAND = HandTemplate()


def finger_tree(side: str) -> Tree:
    """The joints of a hand's fingers, ends besides; the first parent is the hand itself."""
    tree: list[tuple[str, str | None]] = []
    for finger in FINGER_NAMES:
        parts = ("metacarpal", "proximal", "distal") if finger == "thumb" else ("proximal", "intermediate", "distal")
        above = f"{side}_hand"
        for part in (*parts, "distal_end"):
            tree.append((f"{side}_{finger}_{part}", above))
            above = f"{side}_{finger}_{part}"
    return tuple(tree)


HAND_TREES = {side: ((f"{side}_hand", None), *finger_tree(side)) for side in ("left", "right")}


@dataclass(frozen=True)
class QuadrupedTemplate:
    """Shares for an animal on four legs, between those of cats, dogs and horses.

    above_seam: how far the upper joint stands over the leg's seam, of the leg's length.
    fore_leg, hind_leg: where wrist and elbow, hock and stifle are, of the way from the toes to the upper joint.
    spine: joints along hips-withers; spine_height: from belly to back; neck, head: along withers-nose.
    """

    above_seam: float = 0.3
    fore_leg: tuple[float, float] = (0.25, 0.68)
    hind_leg: tuple[float, float] = (0.33, 0.7)
    spine: tuple[float, float] = (0.33, 0.67)
    spine_height: float = 0.7
    neck: float = 0.2
    head: float = 0.55


QUADRUPED = QuadrupedTemplate()

QUADRUPED_TREE: Tree = (
    *_body_tree("foot_end"),
    *_outwards(("hips", "tail_1", "tail_2", "tail_3", "tail_4", "tail_end")),
)
"""Fore legs bear the names of arms, so that what moves a person can move an animal; tails may be missing."""
