"""The T-pose: what it looks like on a body of the database, how well people hold it, and finding it in frames."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.database import MotionDatabase
from reconstruction.kinematics import world_joints
from reconstruction.rotations import mean_of_sum, outer_sum
from reconstruction.skeleton import Skeleton

STILL_M = 0.05
"""Metres: trackers that stay within that, noise aside, are held still."""
_HELD_S = 0.6
"""Seconds, the least that counts as held."""
_PART_S = 0.15
"""Seconds over which positions are averaged before they are compared."""
_ROOT, _HEAD, _LEFT, _RIGHT = (ROLES.index(role) for role in ("root", "head", "left_wrist", "right_wrist"))


@dataclass(frozen=True, eq=False)
class TPose:
    """A pose q (D,) of the database's space, seen from its own heading frame, and its standard deviations (D,).

    trackers: (6, 3) metres, the tracked joints in it.
    """

    q: NDArray[np.float64]
    spread: NDArray[np.float64]
    trackers: NDArray[np.float64]


def hint(positions: NDArray[np.float64]) -> str:
    """What is missing to a T-pose at tracker positions (6, 3) metres, "" where nothing is."""
    lower, upper = _shoulder_range(positions)
    for index, side in ((_LEFT, "left"), (_RIGHT, "right")):
        height = positions[index, 1]
        if np.isnan(height):
            continue
        if height < lower:
            return f"raise your {side} arm to the height of your shoulder"
        if height > upper:
            return f"lower your {side} arm to the height of your shoulder"
    apart = np.hypot(*(positions[_LEFT] - positions[_RIGHT])[[0, 2]])
    if apart < 0.72 * _tall(positions):
        return "stretch both arms out to the sides"
    return ""


def _tall(positions: NDArray[np.float64]) -> float:
    """Metres, roughly the height of the head's joint; NaN where neither head nor root is there."""
    head, root = positions[_HEAD, 1], positions[_ROOT, 1]
    return float(head if np.isfinite(head) else 1.65 * root)


def _shoulder_range(positions: NDArray[np.float64]) -> tuple[float, float]:
    tall = _tall(positions)
    return 0.7 * tall, 1.12 * tall


class Stillness:
    """Tells, frame by frame, for how long all trackers have been still."""

    def __init__(self) -> None:
        self._part: list[TrackerFrame] = []
        self._means: deque[tuple[float, NDArray[np.float64]]] = deque()

    def add(self, frame: TrackerFrame) -> None:
        """Takes in one frame."""
        if self._part and frame.time_s - self._part[-1].time_s > 0.5:
            self._part.clear()
            self._means.clear()
        self._part.append(frame)
        if frame.time_s - self._part[0].time_s < _PART_S:
            return
        self._means.append((self._part[0].time_s, mean_positions(self._part)))
        self._part.clear()
        latest = self._means[-1][1]
        moved = [number for number, (_, mean) in enumerate(self._means) if not _near(mean, latest)]
        for _ in range(moved[-1] + 1 if moved else 0):
            self._means.popleft()

    @property
    def since_s(self) -> float:
        """The time of the first frame of the still stretch that goes on now; infinite where there is none."""
        return self._means[0][0] if self._means else np.inf

    @property
    def positions(self) -> NDArray[np.float64]:
        """(6, 3) metres, where the trackers have been lately; NaN where they have not."""
        return self._means[-1][1] if self._means else np.full((len(ROLES), 3), np.nan)


def mean_positions(frames: Sequence[TrackerFrame]) -> NDArray[np.float64]:
    """(6, 3) metres, means over the frames that have the role, NaN where none has."""
    seen = np.array([frame.positions for frame in frames])
    count = np.isfinite(seen[..., 0]).sum(axis=0)[:, None]
    return np.where(count > 0, np.nansum(seen, axis=0) / np.maximum(count, 1), np.nan)


def mean_orientations(frames: Sequence[TrackerFrame]) -> NDArray[np.float64]:
    """(6, 4) mean rotations over the frames that have the role's, NaN where none has."""
    seen = np.array([frame.orientations for frame in frames])
    out = np.full(seen.shape[1:], np.nan)
    for role in range(len(out)):
        there = seen[np.isfinite(seen[:, role, 0]), role]
        if len(there):
            out[role] = mean_of_sum(outer_sum(there[:, None]))[0]
    return out


def _near(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    away = np.linalg.norm(a - b, axis=1)
    return bool(np.all(away[np.isfinite(away)] < STILL_M))


def found_t_pose(frames: Sequence[TrackerFrame]) -> tuple[float, float] | None:
    """First and last second of the longest stretch in which a T-pose is held, or None where there is none."""
    stillness, best = Stillness(), None
    for frame in frames:
        stillness.add(frame)
        positions, since = stillness.positions, stillness.since_s
        if not np.isfinite(positions[[_LEFT, _RIGHT], 0]).all() or np.isnan(_tall(positions)):
            continue
        held = frame.time_s - since
        if held >= _HELD_S and not hint(positions) and (best is None or held > best[1] - best[0]):
            best = (since, frame.time_s)
    return best


_STANDING_ROWS = 300
"""Rows of the database whose mean is taken as how people stand."""
_LOOSE = {
    "hips": 0.06,
    "spine": 0.05,
    "chest": 0.05,
    "upper_chest": 0.05,
    "neck": 0.08,
    "head": 0.10,
    "shoulder": 0.08,
    "upper_arm": 0.12,
    "lower_arm": 0.12,
    "hand": 0.15,
    "upper_leg": 0.06,
    "lower_leg": 0.06,
    "foot": 0.10,
    "toes": 0.10,
}
"""Radians about each axis by which a person's T-pose differs from ours (set by us)."""
_HEIGHT_SPREAD_M = 0.01
"""Metres: shoes, soft floors."""


def t_pose(database: MotionDatabase) -> TPose:
    """The T-pose of the database's body: it stands as people do there, with its limbs straightened.

    Trunk and feet are the mean of the rows that stand straightest; legs are swung down and arms out from there by
    the smallest arcs, so that no twist is invented.
    """
    space, skeleton = database.space, database.space.skeleton
    poses = np.asarray(database.poses[:: max(1, len(database) // 30_000)], np.float64)
    q = poses[_straightest(database, poses)].mean(axis=0)
    q[[0, 2]] = 0.0
    rotations = space.rotations(q[None], np.zeros(3))[0]
    _straighten(skeleton, rotations)
    q = space.coordinates(np.array([[0.0, q[1], 0.0]]), rotations[None], np.zeros(3))[0]
    joints, _ = world_joints(skeleton, np.zeros(3), rotations)
    ankles = [skeleton.role_joint(role) for role in ("left_ankle", "right_ankle")]
    standing, _ = floors(database)
    q[1] = standing - joints[ankles, 1].mean()
    trackers = joints[[skeleton.role_joint(role) for role in ROLES]] + (0.0, q[1], 0.0)
    return TPose(q, _spread(database), trackers)


def floors(database: MotionDatabase) -> tuple[float, NDArray[np.float64]]:
    """Metres: the height of ankles that carry the body over the floor, and how high each clip's floor is (clips,).

    Motion capture's floors are not all at zero; most are near it, so that the median of all clips is.
    """
    ankles = [ROLES.index("left_ankle"), ROLES.index("right_ankle")]
    low = np.array(
        [
            np.percentile(
                np.asarray(database.tracks[clip.first : clip.first + clip.frames])[:, ankles, 1].min(axis=1), 10
            )
            for clip in database.clips
        ]
    )
    return float(np.median(low)), low - np.median(low)


def _spread(database: MotionDatabase) -> NDArray[np.float64]:
    """(D,) standard deviations of a held T-pose; the root's place and facing are anywhere."""
    names = {joint: bone.removeprefix("left_").removeprefix("right_") for bone, joint in _humanoid(database)}
    spread = np.full(database.space.dof, 0.03)
    for number, joint in enumerate(database.space.moving):
        spread[6 + 3 * number : 9 + 3 * number] = _LOOSE.get(names.get(int(joint), ""), 0.03)
    spread[:6] = 10.0, _HEIGHT_SPREAD_M, 10.0, _LOOSE["hips"], 3.0, _LOOSE["hips"]
    return spread


def _humanoid(database: MotionDatabase) -> list[tuple[str, int]]:
    return list(database.space.skeleton.humanoid.items())


def _straightest(database: MotionDatabase, poses: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rows (n,) of poses (N, D) that stand: legs straight and together, trunk upright."""
    from reconstruction.body_kinematics import Body, joint_positions

    joints = joint_positions(Body.of(database.space), poses)
    bones = database.space.skeleton.humanoid
    leg = []
    for side in ("left", "right"):
        hip, ankle = (joints[:, bones[f"{side}_{bone}"]] for bone in ("upper_leg", "foot"))
        leg.append(hip - ankle)
    lean = joints[:, bones["head"]] - joints[:, bones["hips"]]
    upright = (leg[0][:, 1] + leg[1][:, 1] + lean[:, 1]) - 0.5 * np.hypot(lean[:, 0], lean[:, 2])
    apart = joints[:, bones["left_foot"]] - joints[:, bones["right_foot"]]
    return np.argsort(-(upright - 0.5 * np.abs(apart[:, 2])))[:_STANDING_ROWS]


def _straighten(skeleton: Skeleton, rotations: NDArray[np.float64]) -> None:
    """Swings the limbs of local rotations (J, 4) straight, in place: legs down, arms out to the sides."""
    bones = skeleton.humanoid
    ways = [("upper_leg", "lower_leg", (0.05, -1.0, 0.0)), ("lower_leg", "foot", (0.02, -1.0, 0.0))]
    ways += [("upper_arm", "lower_arm", (1.0, 0.0, 0.0)), ("lower_arm", "hand", (1.0, 0.0, 0.0))]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        foot = bones[f"{side}_foot"]
        before = Rotation.from_matrix(world_joints(skeleton, np.zeros(3), rotations)[1][foot])
        for bone, end, way in ways:
            joint = bones[f"{side}_{bone}"]
            at, world = world_joints(skeleton, np.zeros(3), rotations)
            now = at[bones[f"{side}_{end}"]] - at[joint]
            aim = np.array(way) * (sign, 1.0, 1.0)
            _turn(rotations, joint, _smallest_arc(now, aim), world)
            if end == "foot":
                _, world = world_joints(skeleton, np.zeros(3), rotations)
                _turn(rotations, foot, before * Rotation.from_matrix(world[foot]).inv(), world)
        at, world = world_joints(skeleton, np.zeros(3), rotations)
        arm = bones[f"{side}_lower_arm"]
        hand = bones[f"{side}_hand"]
        ends = [c for c in skeleton.children[hand] if np.linalg.norm(skeleton.offsets[c]) > 1e-6]
        if ends:
            _turn(rotations, hand, _smallest_arc(at[ends[0]] - at[hand], at[hand] - at[arm]), world)


def _turn(rotations: NDArray[np.float64], joint: int, turn: Rotation, world: NDArray[np.float64]) -> None:
    own = Rotation.from_matrix(world[joint])
    rotations[joint] = (Rotation.from_quat(rotations[joint]) * own.inv() * turn * own).as_quat()


def _smallest_arc(start: NDArray[np.float64], end: NDArray[np.float64]) -> Rotation:
    axis = np.cross(start, end)
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return Rotation.identity()
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, start @ end))
