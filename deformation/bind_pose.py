"""The pose in which a character is modelled, found for any skeleton.

Legs straight and a little apart, arms straight and 45 degrees below the horizontal: midway of what shoulders and hips
do, so that skinning has to bend every part least, and no two limbs touch. Facing +Z, feet on the floor y = 0.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.errors import SixpointError
from reconstruction.kinematics import world_joints
from reconstruction.motion import Pose
from reconstruction.skeleton import Skeleton
from reconstruction.stature import stature

_ARM_DROP = np.radians(45)
_LEG_SPREAD = np.radians(6)
_TOE_OUT = np.radians(5)
_FOOT_PITCH = np.radians(16)
_BALL_HEIGHT = 0.018
"""Height of the toe joint above the sole as a share of stature; between 1.2 and 2.8 % in captured walks."""

_AS_MODELLED = np.radians(30)
"""Where the rest pose means something, spine, collar bones and feet this near to their canonical direction stay."""

_SPINE = ("hips", "spine", "chest", "upper_chest", "neck", "head")
_LIMBS = (("shoulder", "upper_arm", "lower_arm", "hand"), ("upper_leg", "lower_leg", "foot", "toes"))


def bind_pose(skeleton: Skeleton, reference: Pose | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Root position (3,) metres and local rotations (J, 4) quaternions (x, y, z, w) of the bind pose.

    From the rest pose each bone is swung onto its canonical direction by the smallest arc, parents first, so that no
    twist is invented. Some files' rest pose is no pose of a person (every bone along one axis): there the swings start
    from `reference`, any pose of the motion, best one that stands. Raises SixpointError for a skeleton without legs.
    """
    posed = _Posing(skeleton)
    as_modelled = posed.is_upright()
    if not as_modelled and reference is not None:
        posed.rotations = np.array(reference.rotations, float)
    pitches, ball_height = (_FOOT_PITCH, 0.0), _BALL_HEIGHT * stature(skeleton)
    if not as_modelled and reference is not None:
        pitches, ball_height = _planted_foot(skeleton, reference)
    posed.face_forward(0.0 if not as_modelled else _AS_MODELLED)
    for bone, direction, loose in _aims(*pitches):
        if bone == "left_shoulder" and not as_modelled:
            posed.square_shoulders()
        posed.aim(bone, direction, _AS_MODELLED if loose and as_modelled else 0.0)
    return posed.root_on_floor(ball_height), posed.rotations


def _aims(foot_pitch: float, toe_pitch: float) -> Iterator[tuple[str, NDArray[np.float64], bool]]:
    """Bone, canonical direction (3,), and whether it may stay as modelled; parents before children."""
    for bone in _SPINE:
        yield bone, np.array([0.0, 1.0, 0.0]), True
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = np.array([sign * np.cos(_ARM_DROP), -np.sin(_ARM_DROP), 0.0])
        leg = np.array([sign * np.sin(_LEG_SPREAD), -np.cos(_LEG_SPREAD), 0.0])
        out = np.array([sign * np.sin(_TOE_OUT), 0.0, np.cos(_TOE_OUT)])
        foot, toes = (out * np.cos(pitch) - np.array([0.0, np.sin(pitch), 0.0]) for pitch in (foot_pitch, toe_pitch))
        yield f"{side}_shoulder", np.array([sign, 0.0, 0.0]), True
        yield from ((f"{side}_{bone}", arm, False) for bone in ("upper_arm", "lower_arm", "hand"))
        yield from ((f"{side}_{bone}", leg, False) for bone in ("upper_leg", "lower_leg"))
        yield f"{side}_foot", foot, True
        yield f"{side}_toes", toes, True


def _planted_foot(skeleton: Skeleton, reference: Pose) -> tuple[tuple[float, float], float]:
    """How far foot and toes of the lower foot in a pose point down, radians, and its toe joint's height in metres.

    Joints of feet stand where a file's maker put them: only a standing foot tells which way they point when it is flat.
    """
    posed, height = _Posing(skeleton), stature(skeleton)
    posed.rotations = np.array(reference.rotations, float)
    heights = posed.world()[0][:, 1] + reference.root_position[1]
    toes = {side: heights[posed.bones[f"{side}_toes"]] for side in ("left", "right") if f"{side}_toes" in posed.bones}
    if not toes:
        return (_FOOT_PITCH, 0.0), _BALL_HEIGHT * height
    side = min(toes, key=lambda side: toes[side])
    foot, toe = (posed.direction(f"{side}_{bone}") for bone in ("foot", "toes"))
    pitches = (_pitch(foot, _FOOT_PITCH), _pitch(toe, 0.0))
    return pitches, float(np.clip(toes[side], 0.012 * height, 0.028 * height))


def _pitch(direction: NDArray[np.float64] | None, otherwise: float) -> float:
    return otherwise if direction is None else float(-np.arcsin(np.clip(direction[1], -1, 1)))


class _Posing:
    """A skeleton while its joints are being turned. rotations: (J, 4) local quaternions."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self.bones = skeleton.humanoid
        self.rotations = np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), 1))
        if "hips" not in self.bones:
            raise SixpointError(f"the skeleton has no hips: its joints are {', '.join(skeleton.names)}")

    def world(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return world_joints(self.skeleton, np.zeros(3), self.rotations)

    def is_upright(self) -> bool:
        """Whether spine and thighs run opposite ways and the thighs do not splay by more than 60 degrees."""
        legs = [self.direction(f"{side}_upper_leg") for side in ("left", "right")]
        up = self.up()
        return all(leg is not None and leg @ up < -0.5 for leg in legs)

    def up(self) -> NDArray[np.float64]:
        """(3,) from the hips along the spine."""
        position, _ = self.world()
        top = next((self.bones[b] for b in ("neck", "head", "upper_chest", "chest", "spine") if b in self.bones), None)
        return np.array([0.0, 1.0, 0.0]) if top is None else _unit(position[top] - position[self.bones["hips"]])

    def face_forward(self, tolerance: float) -> None:
        """Turns the root so that the line of the hips is +X and the lower spine +Y."""
        position, world = self.world()
        hips = self.bones["hips"]
        left, right = (self.bones.get(f"{side}_upper_leg") for side in ("left", "right"))
        spine = self.target("hips")
        if left is None or right is None or spine is None:
            return
        lateral = _unit(position[left] - position[right])
        up = position[spine] - position[hips]
        up = _unit(up - (up @ lateral) * lateral)
        turn = Rotation.from_matrix(np.stack([lateral, up, np.cross(lateral, up)]))
        if turn.magnitude() > tolerance:
            self.turn(hips, turn, world)

    def square_shoulders(self) -> None:
        """Twists the joint that carries both arms about the vertical until its line of shoulders is +X."""
        arms = [self.bones.get(f"{s}_shoulder", self.bones.get(f"{s}_upper_arm")) for s in ("left", "right")]
        if arms[0] is None or arms[1] is None:
            return
        position, world = self.world()
        line = position[arms[0]] - position[arms[1]]
        carrier = self._common_ancestor(arms[0], arms[1])
        if np.hypot(line[0], line[2]) > 1e-3:
            self.turn(carrier, Rotation.from_rotvec([0.0, np.arctan2(line[2], line[0]), 0.0]), world)

    def _common_ancestor(self, a: int, b: int) -> int:
        above = set()
        while a >= 0:
            above.add(a)
            a = int(self.skeleton.parents[a])
        while b not in above:
            b = int(self.skeleton.parents[b])
        return b

    def aim(self, bone: str, direction: NDArray[np.float64], tolerance: float) -> None:
        """Swings a bone onto a world direction by the smallest arc; nearer than `tolerance` radians it stays."""
        now = self.direction(bone)
        if now is None:
            return
        swing = _smallest_arc(now, direction)
        if swing.magnitude() > tolerance:
            self.turn(self.bones[bone], swing, self.world()[1])

    def direction(self, bone: str) -> NDArray[np.float64] | None:
        """(3,) where a bone points in the world now, None for a bone that the skeleton lacks.

        A last bone without an end continues its parent's axis: true of rests in a T and of bones along one axis alike.
        """
        joint, target = self.bones.get(bone), self.target(bone)
        if joint is None:
            return None
        position, world = self.world()
        if target is not None:
            return _unit(position[target] - position[joint])
        if np.linalg.norm(self.skeleton.offsets[joint]) < 1e-6:
            return None
        return world[joint] @ _unit(self.skeleton.offsets[joint])

    def target(self, bone: str) -> int | None:
        """The joint that a bone points at: the next humanoid bone not in the same place, or else its farthest child."""
        joint = self.bones.get(bone)
        if joint is None:
            return None
        position, _ = self.world()
        for after in (self.bones.get(name) for name in _bones_after(bone)):
            if after is not None and np.linalg.norm(position[after] - position[joint]) > 1e-6:
                return after
        children = [c for c in self.skeleton.children[joint] if np.linalg.norm(self.skeleton.offsets[c]) > 1e-6]
        if bone == "hips" or not children:
            return None
        return max(children, key=lambda child: float(np.linalg.norm(self.skeleton.offsets[child])))

    def turn(self, joint: int, turn: Rotation, world: NDArray[np.float64]) -> None:
        """Turns a joint, and all that hangs on it, by a rotation given in the world."""
        own = Rotation.from_matrix(world[joint])
        local = own.inv() * turn * own
        self.rotations[joint] = (Rotation.from_quat(self.rotations[joint]) * local).as_quat()

    def root_on_floor(self, ball_height: float) -> NDArray[np.float64]:
        """Root position (3,) that puts the toe joints `ball_height` above y = 0 and the hips over the origin."""
        position, _ = self.world()
        toes = [position[self.bones[f"{s}_toes"], 1] for s in ("left", "right") if f"{s}_toes" in self.bones]
        ankles = [position[self.bones[f"{s}_foot"], 1] for s in ("left", "right") if f"{s}_foot" in self.bones]
        lowest = min(toes) - ball_height if toes else min(ankles) - 0.039 * stature(self.skeleton)
        return np.array([0.0, -lowest, 0.0])


def _bones_after(bone: str) -> tuple[str, ...]:
    if bone in _SPINE:
        return _SPINE[_SPINE.index(bone) + 1 :]
    side, _, part = bone.partition("_")
    chain = next(limb for limb in _LIMBS if part in limb)
    return tuple(f"{side}_{after}" for after in chain[chain.index(part) + 1 :])


def _smallest_arc(start: NDArray[np.float64], end: NDArray[np.float64]) -> Rotation:
    """The smallest rotation between unit vectors (3,); half a turn goes about the lateral axis X."""
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis), float(start @ end)
    if sine < 1e-9:
        return Rotation.identity() if cosine > 0 else Rotation.from_rotvec([np.pi, 0.0, 0.0])
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine))


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector / max(float(np.linalg.norm(vector)), 1e-12)
