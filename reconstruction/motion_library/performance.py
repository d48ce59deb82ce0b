"""What a body does over time, in channels an animator would name; actions write them, `bake` makes a motion of them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.frame import frozen
from reconstruction.motion import Motion
from reconstruction.motion_library.axes import MIRROR, about_x, about_y, about_z, turned
from reconstruction.motion_library.easing import smooth_cover
from reconstruction.motion_library.limbs import FULL_REACH, arm_frame, frame_from, local, place, two_bone
from reconstruction.skeleton import Skeleton

Array = NDArray[np.float64]

SIDES = ("Left", "Right")
SPINE = ("Spine", "Spine1", "Spine2")
_SPINE_SHARES = (0.30, 0.35, 0.35)
_FINGERTIPS_IN = np.radians(7.0)


@dataclass
class Performance:
    """The channels of one clip, T frames; radians, and metres in the world. Sided arrays are (left, right).

    pelvis_position (T, 3); pelvis_turn, pelvis_lean, pelvis_list (T,): about up, forward, left side up.
    spine_turn, spine_lean, spine_side (T,): chest against pelvis. head_turn, head_nod, head_tilt (T,): head against it.
    shoulder_raise (T, 2). arm_flex, arm_abduct, arm_twist, elbow, pronate, wrist (T, 2): forward, outward, forearm
    inward, bent, palm back, fingers to the palm. The hand targets (T, 2, 3) win over the arm angles by
    `hand_weight` (T, 2); elbows point to `elbow_pole` (T, 2, 3).
    ankle (T, 2, 3); foot_turn, foot_pitch, toe_bend (T, 2): about up, toes above heel, toes against the foot.
    """

    skeleton: Skeleton
    times: Array
    pelvis_position: Array = field(init=False)
    ankle: Array = field(init=False)
    hand_target: Array = field(init=False)
    elbow_pole: Array = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.times)
        self.pelvis_position = np.zeros((count, 3))
        self.pelvis_turn, self.pelvis_lean, self.pelvis_list = (np.zeros(count) for _ in range(3))
        self.spine_turn, self.spine_lean, self.spine_side = (np.zeros(count) for _ in range(3))
        self.head_turn, self.head_nod, self.head_tilt = (np.zeros(count) for _ in range(3))
        self.shoulder_raise, self.arm_flex, self.arm_abduct = (np.zeros((count, 2)) for _ in range(3))
        self.arm_twist, self.elbow, self.pronate = (np.zeros((count, 2)) for _ in range(3))
        self.wrist, self.hand_weight = (np.zeros((count, 2)) for _ in range(2))
        self.foot_turn, self.foot_pitch, self.toe_bend = (np.zeros((count, 2)) for _ in range(3))
        self.ankle, self.hand_target = np.zeros((count, 2, 3)), np.zeros((count, 2, 3))
        self.elbow_pole = np.tile([0.0, -1.0, -0.3], (count, 2, 1))

    @property
    def fps(self) -> float:
        """Frames a second."""
        return 1.0 / (self.times[1] - self.times[0])

    @property
    def stature(self) -> float:
        """Metres; the standard body's hips stand at 0.545 of it."""
        return float(self.skeleton.offsets[0, 1] / 0.545)

    def offset(self, joint: str) -> Array:
        """(3,) metres, the joint's rest offset from its parent."""
        return self.skeleton.offsets[self.skeleton.names.index(joint)]

    def pelvis(self) -> Array:
        """(T, 3, 3) `R_world_pelvis`."""
        return about_y(self.pelvis_turn) @ about_x(self.pelvis_lean) @ about_z(self.pelvis_list)

    def hips(self) -> Array:
        """(T, 2, 3) metres, world: the hip joints."""
        rotation = self.pelvis()
        return np.stack([place(self.pelvis_position, rotation, self.offset(f"{s}UpLeg")) for s in SIDES], axis=1)

    def trunk(self) -> dict[str, tuple[Array, Array]]:
        """World position (T, 3) and rotation (T, 3, 3) of the hips and each spine joint, the last one the chest."""
        position, rotation = self.pelvis_position, self.pelvis()
        chain = {"Hips": (position, rotation)}
        for joint, share in zip(SPINE, _SPINE_SHARES, strict=True):
            position = place(position, rotation, self.offset(joint))
            turn, lean, side = (
                about_y(share * self.spine_turn),
                about_x(share * self.spine_lean),
                share * self.spine_side,
            )
            rotation = rotation @ turn @ lean @ about_z(side)
            chain[joint] = (position, rotation)
        return chain


def bake(performance: Performance, name: str, first: int = 0, last: int | None = None) -> Motion:
    """The motion of a performance's frames `first` to `last`: trunk by its angles, arms and legs to their targets.

    The pelvis sinks, smoothly, wherever a leg could not reach its foot otherwise.
    """
    p = performance
    lower_to_reach(p)
    chain = p.trunk()
    world = {joint: rotation for joint, (_, rotation) in chain.items()}
    chest_position, chest = chain["Spine2"]
    world["Neck"] = chest @ about_y(0.4 * p.head_turn) @ about_x(0.4 * p.head_nod) @ about_z(0.4 * p.head_tilt)
    world["Head"] = world["Neck"] @ about_y(0.6 * p.head_turn) @ about_x(0.6 * p.head_nod) @ about_z(0.6 * p.head_tilt)
    for side in range(2):
        _arm(p, side, chest_position, chest, world)
        _leg(p, side, world)
    return _motion(p.skeleton, p.pelvis_position, world, p.fps, name, slice(first, last))


def lower_to_reach(p: Performance) -> None:
    """Sinks the pelvis where a hip is further from its ankle than the leg is long, smoothly over a quarter second."""
    reach = FULL_REACH * -(p.offset("LeftLeg")[1] + p.offset("LeftFoot")[1])
    span = p.hips() - p.ankle
    level = (span[..., [0, 2]] ** 2).sum(-1)
    highest = p.ankle[..., 1] + np.sqrt(np.maximum(reach**2 - level, 0.0))
    excess = np.maximum(p.hips()[..., 1] - highest, 0.0).max(1)
    p.pelvis_position[:, 1] -= smooth_cover(excess, max(round(0.12 * p.fps), 1))


def _leg(p: Performance, side: int, world: dict[str, Array]) -> None:
    name = SIDES[side]
    pelvis = world["Hips"]
    foot = about_y(p.foot_turn[:, side]) @ about_x(-p.foot_pitch[:, side])
    hinge = pelvis[..., 0] + foot[..., 0]
    upper, lower = -p.offset(f"{name}Leg")[1], -p.offset(f"{name}Foot")[1]
    thigh, shin, axis, _ = two_bone(p.hips()[:, side], p.ankle[:, side], hinge, upper, lower)
    world[f"{name}UpLeg"], world[f"{name}Leg"] = frame_from(thigh, axis), frame_from(shin, axis)
    world[f"{name}Foot"] = foot
    world[f"{name}ToeBase"] = foot @ about_x(-p.toe_bend[:, side])


def _arm(p: Performance, side: int, chest_position: Array, chest: Array, world: dict[str, Array]) -> None:
    """Both arms are worked out as left ones; the right one is the left of the mirrored body."""
    name = SIDES[side]
    mirror = MIRROR if side else np.eye(3)
    shoulder = chest @ (mirror @ about_z(p.shoulder_raise[:, side]) @ mirror)
    world[f"{name}Shoulder"] = shoulder
    upper, fore = _arm_by_angles(p, side)
    if p.hand_weight[:, side].any():
        to_chest = mirror @ np.swapaxes(chest, -1, -2)
        socket = place(place(chest_position, chest, p.offset(f"{name}Shoulder")), shoulder, p.offset(f"{name}Arm"))
        target = turned(to_chest, p.hand_target[:, side] - socket)
        pole = turned(to_chest, p.elbow_pole[:, side])
        lengths = abs(p.offset("LeftForeArm")[0]), abs(p.offset("LeftHand")[0])
        along, _, hinge, bend = two_bone(np.zeros_like(target), target, np.cross(pole, target), *lengths)
        weight = p.hand_weight[:, side]
        upper = _between(upper, arm_frame(along, hinge), weight)
        fore = _between(fore, about_y(-bend) @ about_x(p.pronate[:, side]), weight)
    hand = about_z(-p.wrist[:, side] - _FINGERTIPS_IN)
    world[f"{name}Arm"] = chest @ (mirror @ upper @ mirror)
    world[f"{name}ForeArm"] = world[f"{name}Arm"] @ (mirror @ fore @ mirror)
    world[f"{name}Hand"] = world[f"{name}ForeArm"] @ (mirror @ hand @ mirror)


def _arm_by_angles(p: Performance, side: int) -> tuple[Array, Array]:
    """(T, 3, 3) the upper arm against the chest and the forearm against it, of a left arm that hangs at zero angles."""
    swing = about_x(-p.arm_flex[:, side]) @ about_z(p.arm_abduct[:, side]) @ about_y(-p.arm_twist[:, side])
    upper = swing @ about_z(np.full(len(p.times), -np.pi / 2))
    return upper, about_y(-p.elbow[:, side]) @ about_x(p.pronate[:, side])


def _between(first: Array, second: Array, weight: Array) -> Array:
    """(T, 3, 3) from `first` at weight 0 to `second` at 1 along the shortest turn."""
    difference = Rotation.from_matrix(local(first, second)).as_rotvec()
    return first @ Rotation.from_rotvec(weight[:, None] * difference).as_matrix()


def _motion(skeleton: Skeleton, root: Array, world: dict[str, Array], fps: float, name: str, frames: slice) -> Motion:
    root = root[frames]
    matrices = np.tile(np.eye(3), (len(root), len(skeleton), 1, 1))
    for joint, parent in enumerate(skeleton.parents):
        bone = skeleton.names[joint]
        if bone in world:
            above = world[skeleton.names[parent]][frames] if parent >= 0 else np.eye(3)
            matrices[:, joint] = local(above, world[bone][frames])
    quaternions = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_quat().reshape(*matrices.shape[:2], 4)
    signs = np.sign((quaternions[1:] * quaternions[:-1]).sum(-1, keepdims=True))
    quaternions[1:] *= np.cumprod(signs, axis=0)
    return Motion(skeleton, frozen(np.ascontiguousarray(root)), frozen(quaternions), fps, name)
