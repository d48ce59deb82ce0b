"""A motion of one skeleton carried to another with its own rest pose, joints and proportions.

Both skeletons are put into the same bind pose (`deformation.bind_pose`). Each bone then turns in the world, away from
that pose, as its counterpart does: R'_j(t) = R_s(t) R_s(bind)^-1 R'_j(bind). Strides are scaled by the length of the
legs, and the soles are as high above the floor as they were, in the same scale, but never below it. Legs then bend so
that the feet stand where the performer's do (`deformation.foot_placement`). Fingers go by their names.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.bind_pose import bind_pose
from deformation.foot_placement import Leg, hips_drop, make_leg, reaching, standing
from deformation.heat_weights import subtree
from devices.errors import SixpointError
from devices.frame import frozen
from reconstruction.joint_names import plain_name
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion, Pose
from reconstruction.skeleton import Skeleton
from reconstruction.stature import stature

_NEEDED = ("hips", *(f"{s}_{b}" for s in ("left", "right") for b in ("upper_leg", "lower_leg", "foot")))
_HEEL_M, _TIP_M = 0.035, 0.045
"""Heel behind the ankle and tip of the toes before their joint, as shares of stature."""


class Retargeter:
    """Carries poses from one skeleton to another.

    source_reference, target_reference: poses that stand, for skeletons whose rest pose is none (see `bind_pose`).
    target_bind: (J', 4, 4) `T_world_joint` in which a character stands on y = 0, so that its own soles meet the floor.
    Raises SixpointError naming the bones that a skeleton lacks.
    """

    def __init__(
        self,
        source: Skeleton,
        target: Skeleton,
        source_reference: Pose | None = None,
        target_reference: Pose | None = None,
        target_bind: NDArray[np.float64] | None = None,
    ) -> None:
        for skeleton in (source, target):
            missing = [bone for bone in _NEEDED if bone not in skeleton.humanoid]
            if missing:
                raise SixpointError(f"no {', '.join(missing)} among the joints {', '.join(skeleton.names)}")
        self.source, self.target = source, target
        source_at, source_turns = world_joints(source, *bind_pose(source, source_reference))
        target_root, self._local_bind = bind_pose(target, target_reference)
        target_at, target_turns = world_joints(target, target_root, self._local_bind)
        if target_bind is not None:
            target_at[:, 1] += _ball_height(target, target_bind[:, :3, 3]) - _ball_height(target, target_at)
        self._pairs = [
            (joint, source.humanoid[bone]) for bone, joint in target.humanoid.items() if bone in source.humanoid
        ]
        self._pairs += _finger_pairs(source, target)
        self._from_source = {t: source_turns[s].T @ target_turns[t] for t, s in self._pairs}
        self._hips = target.humanoid["hips"], source.humanoid["hips"]
        self.scale = _leg_height(target, target_at) / _leg_height(source, source_at)
        self._target_soles = _Soles(target, target_at, target_turns)
        self._source_soles = _Soles(source, source_at, source_turns)
        self._legs = [
            make_leg(
                target.humanoid[f"{side}_upper_leg"],
                target.humanoid[f"{side}_lower_leg"],
                target.humanoid[f"{side}_foot"],
                target_turns,
            )
            for side in ("left", "right")
        ]
        self._balls = [
            _ball(side, source, target, source_at, target_at, source_turns, self.scale) for side in ("left", "right")
        ]

    def motion(self, motion: Motion) -> Motion:
        """The whole motion on the target skeleton. Raises SixpointError if it is not of the source skeleton."""
        if not motion.skeleton.same_tree(self.source):
            raise SixpointError(f"the motion {motion.name!r} is of another skeleton than the one to carry it from")
        root, rotations = self._carried(motion.root_positions, motion.rotations)
        return Motion(self.target, frozen(root), frozen(rotations), motion.fps, motion.name)

    def pose(self, pose: Pose) -> Pose:
        """One pose on the target skeleton."""
        root, rotations = self._carried(pose.root_position[None], pose.rotations[None])
        return Pose(pose.time_s, frozen(root[0]), frozen(rotations[0]))

    def _carried(
        self, root_positions: NDArray[np.float64], rotations: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Root positions (T, 3) and local rotations (T, J', 4) of the target for (T, 3) and (T, J, 4)."""
        at, turns = world_joints(self.source, root_positions, rotations)
        target_at, target_turns, local = self._turned(turns)
        hips, source_hips = self._hips
        wanted = np.maximum(self.scale * self._source_soles.lowest(at, turns), 0.0)
        soles = self._target_soles.lowest(target_at, target_turns)
        root = self.scale * at[:, source_hips] - target_at[:, hips]
        root[:, 1] = wanted.min(axis=1) - soles.min(axis=1)
        target_at += root[:, None, :]
        goals = [
            self._ankle_goal(side, at, turns, target_at, root[:, 1] + soles[:, side], wanted[:, side])
            for side in range(len(self._legs))
        ]
        stood = [standing(leg, target_at, wanted[:, side]) for side, leg in enumerate(self._legs)]
        drops = [w * hips_drop(leg, target_at, goal) for leg, goal, w in zip(self._legs, goals, stood, strict=True)]
        down = np.max(drops, axis=0)
        root[:, 1] -= down
        target_at[:, :, 1] -= down[:, None]
        for leg, goal in zip(self._legs, goals, strict=True):
            self._bend(leg, target_at, target_turns, goal, local)
        return root, Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(len(local), -1, 4)

    def _turned(
        self, turns: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Places (T, J', 3) with the root at the origin, rotations in the world and against the parent (T, J', 3, 3).

        Joints with a counterpart take its turn in the world, all others stay as in the bind pose.
        """
        count, matched = len(turns), dict(self._pairs)
        bind = Rotation.from_quat(self._local_bind).as_matrix()
        at = np.zeros((count, len(self.target), 3))
        world = np.empty((count, len(self.target), 3, 3))
        local = np.empty_like(world)
        for joint, parent in enumerate(self.target.parents):
            above = world[:, parent] if parent >= 0 else np.broadcast_to(np.eye(3), (count, 3, 3))
            if parent >= 0:
                at[:, joint] = at[:, parent] + above @ self.target.offsets[joint]
            if joint in matched:
                world[:, joint] = turns[:, matched[joint]] @ self._from_source[joint]
            else:
                world[:, joint] = above @ bind[joint]
            local[:, joint] = above.transpose(0, 2, 1) @ world[:, joint]
        return at, world, local

    def _ankle_goal(
        self,
        side: int,
        at: NDArray[np.float64],
        turns: NDArray[np.float64],
        target_at: NDArray[np.float64],
        sole: NDArray[np.float64],
        wanted: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """(T, 3) metres: where an ankle has to be for its foot to stand as the performer's does.

        at, turns: the performer's; target_at: (T, J', 3) metres without bending; sole: (T,) the sole's height then,
        wanted: (T,) what it should be.
        """
        leg, ball = self._legs[side], self._balls[side]
        stands = ball.of_source(self.scale, at, turns) - target_at[:, ball.joint]
        stands[:, 1] = wanted - sole
        goal = target_at[:, leg.foot] + standing(leg, target_at, wanted)[:, None] * stands
        goal[:, 1] += np.maximum(-sole - (goal - target_at[:, leg.foot])[:, 1], 0)
        return goal

    def _bend(
        self,
        leg: Leg,
        at: NDArray[np.float64],
        turns: NDArray[np.float64],
        goal: NDArray[np.float64],
        local: NDArray[np.float64],
    ) -> None:
        """Turns thigh and shank so that the ankle comes to its goal, and the foot back as it was: `local` changes."""
        thigh, shank = reaching(leg, at, turns, goal)
        parents = self.target.parents
        back = np.broadcast_to(np.eye(3), thigh.shape)
        for joint, before, after in ((leg.upper, back, thigh), (leg.lower, thigh, shank), (leg.foot, shank, back)):
            above = before @ turns[:, parents[joint]]
            local[:, joint] = above.transpose(0, 2, 1) @ after @ turns[:, joint]


@dataclass(frozen=True, eq=False)
class _Ball:
    """The ball of a foot in both skeletons, or the ankle where one has no toes.

    joint, source_joint: toe joints. apart: (3,) metres from the scaled source's to the target's, hips over hips, in the
    source joint's frame.
    """

    joint: int
    source_joint: int
    apart: NDArray[np.float64]

    def of_source(self, scale: float, at: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, 3) metres: where it should be for the source's joints (T, J, 3) and turns (T, J, 3, 3)."""
        return scale * at[:, self.source_joint] + turns[:, self.source_joint] @ self.apart


def _ball(
    side: str,
    source: Skeleton,
    target: Skeleton,
    source_at: NDArray[np.float64],
    target_at: NDArray[np.float64],
    source_turns: NDArray[np.float64],
    scale: float,
) -> _Ball:
    """at: (J, 3) metres and turns: (J, 3, 3) in the bind poses."""
    bone = f"{side}_toes" if all(f"{side}_toes" in s.humanoid for s in (source, target)) else f"{side}_foot"
    joint, source_joint = target.humanoid[bone], source.humanoid[bone]
    own = target_at[joint] - target_at[target.humanoid["hips"]]
    theirs = source_at[source_joint] - source_at[source.humanoid["hips"]]
    return _Ball(joint, source_joint, source_turns[source_joint].T @ ((own - scale * theirs) * [1, 0, 1]))


def _finger_pairs(source: Skeleton, target: Skeleton) -> list[tuple[int, int]]:
    """Joints below the hands that both skeletons have by the same name: the target's and the source's."""
    pairs = []
    for side in ("left", "right"):
        own, theirs = (_below_hand(skeleton, f"{side}_hand") for skeleton in (target, source))
        pairs += [(joint, theirs[name]) for name, joint in own.items() if name in theirs]
    return pairs


def _below_hand(skeleton: Skeleton, hand: str) -> dict[str, int]:
    """The joints that hang on a hand, by their plain names."""
    below = subtree(skeleton, skeleton.humanoid[hand])[1:] if hand in skeleton.humanoid else []
    return {plain_name(skeleton.names[joint]): joint for joint in below}


class _Soles:
    """Points under a skeleton's feet: heel, ball and tip of the toes, on the floor in the bind pose.

    at: (J, 3) metres, turns: (J, 3, 3) in the bind pose, floor at y = 0.
    """

    def __init__(self, skeleton: Skeleton, at: NDArray[np.float64], turns: NDArray[np.float64]) -> None:
        height, bones = stature(skeleton), skeleton.humanoid
        joints, points = [], []
        for side in ("left", "right"):
            ankle = bones[f"{side}_foot"]
            toes = bones.get(f"{side}_toes", ankle)
            ahead = (at[toes] - at[ankle]) * [1, 0, 1]
            length = float(np.linalg.norm(ahead))
            ahead = ahead / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
            ball = at[toes] if toes != ankle else at[ankle] + 0.08 * height * ahead
            joints += [ankle, toes, toes]
            points += [at[ankle] - _HEEL_M * height * ahead, ball, ball + _TIP_M * height * ahead]
        self._joints = np.array(joints)
        offsets = np.array(points) * [1, 0, 1] - at[self._joints]
        self._local = np.einsum("pji,pj->pi", turns[self._joints], offsets)

    def lowest(self, at: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, 2) metres: the height of each sole's lowest point, left and right, for joints (T, J, 3) and their
        rotations (T, J, 3, 3)."""
        below = np.einsum("tpj,pj->tp", turns[:, self._joints, 1], self._local)
        return (at[:, self._joints, 1] + below).reshape(-1, 2, 3).min(axis=2)


def _ball_height(skeleton: Skeleton, positions: NDArray[np.float64]) -> float:
    """Metres: the lower toe joint's height, or the lower ankle's where there are no toes."""
    bones = skeleton.humanoid
    toes = [bones[f"{side}_toes"] for side in ("left", "right") if f"{side}_toes" in bones]
    return float(positions[toes or [bones["left_foot"], bones["right_foot"]], 1].min())


def _leg_height(skeleton: Skeleton, positions: NDArray[np.float64]) -> float:
    """Metres from hip joints down to the floor in the bind pose, the mean of both."""
    bones = skeleton.humanoid
    return float(np.mean([positions[bones[f"{side}_upper_leg"], 1] for side in ("left", "right")]))
