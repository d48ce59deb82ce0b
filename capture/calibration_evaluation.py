"""How near calibration comes to knowing the performer: made-up bodies in real motion, calibrated and then solved.

Clips are held out as in `evaluation`. A body of other size and proportions than the database's moves as in some of
them, after a T-pose that it holds as people do, with trackers that sit off their joints; it is calibrated from what
they read, and other held-out clips are then solved on what came out, and, for the ideal case, on the true body.
"""

import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from capture.accuracy import Accuracy, accuracy
from capture.evaluation import FPS, Clip, StageProgress, find_clips, kept_database, split_by_action
from deformation.bind_pose import bind_pose
from devices.errors import FileError
from devices.frame import TrackerFrame, TrackerState, frozen
from devices.progress import no_progress
from devices.sample import ROLES
from reconstruction.calibration import SEGMENTS, CalibrationResult, calibrate, scaled
from reconstruction.database import MotionDatabase
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_files import read_motion
from reconstruction.motion_operations import cropped, resampled, retargeted
from reconstruction.mounting import Mounting
from reconstruction.rotations import about_up, exponential, multiply
from reconstruction.skeleton import Skeleton
from reconstruction.solver import reconstruct
from reconstruction.stature import scaled_to_stature, stature

HOLD_S = 3.0
MOVE_S = 15.0
CLIP_S = 4.0
"""Most seconds of one clip, so that the movement is of several kinds."""
TEST_S = 3.0
TEST_CLIPS = 5
ANKLE_SHARE = 0.039
"""Height of the ankle joint over the floor as a share of stature (Drillis and Contini 1966, in Winter)."""
_PAUSE_S = 1.0
"""Between two clips of a take nothing is seen."""


@dataclass(frozen=True)
class GridBody:
    """A performer of the grid. limb_spread: every segment is that share longer or shorter than in proportion;
    offset_cm: the most that a tracker sits off its joint; noise_mm: standard deviation of a sample on each axis;
    turn_noise_deg: of the trackers' orientations, or None for trackers that have none."""

    stature_m: float
    limb_spread: float
    offset_cm: float
    noise_mm: float
    rate_hz: float
    turn_noise_deg: float | None = None

    def with_turns(self, noise_deg: float | None) -> "GridBody":
        """The same performer with trackers that have orientations, of this noise."""
        return replace(self, turn_noise_deg=noise_deg)

    @property
    def title(self) -> str:
        """One line."""
        turns = "" if self.turn_noise_deg is None else f", turns {self.turn_noise_deg:g} deg"
        return (
            f"{self.stature_m:.2f} m, limbs {100 * self.limb_spread:.0f} %, offsets {self.offset_cm:.0f} cm, "
            f"noise {self.noise_mm:g} mm, {self.rate_hz:g} Hz{turns}"
        )


GRID = (
    GridBody(1.75, 0.0, 0, 0, 60),
    GridBody(1.65, 0.1, 0, 1, 60),
    GridBody(1.80, 0.0, 8, 1, 60),
    GridBody(1.70, 0.05, 4, 2, 60),
    GridBody(1.50, 0.1, 4, 1, 60),
    GridBody(1.95, 0.1, 4, 1, 60),
    GridBody(1.75, 0.1, 8, 0, 120),
    GridBody(1.60, 0.1, 8, 2, 60),
    GridBody(1.85, 0.1, 8, 5, 60),
    GridBody(1.50, 0.1, 8, 5, 240),
    GridBody(1.95, 0.1, 8, 2, 120),
    GridBody(1.55, 0.1, 6, 2, 120),
)
"""Within 1.50 to 1.95 m, limbs 10 % off, offsets 8 cm, noise 5 mm, 60 to 240 Hz: corners and what lies between."""


@dataclass(frozen=True, eq=False)
class CalibrationScore:
    """One body. accuracies are means over the test clips; seconds: of processor time that calibrating took;
    length_cm: mean error of the segments' lengths; offset_cm: of the trackers' places from their joints."""

    body: GridBody
    ideal: Accuracy
    calibrated: Accuracy
    plain: Accuracy
    result: CalibrationResult
    length_cm: float
    offset_cm: float
    seconds: float

    @property
    def ratio(self) -> float:
        """Centimetres with the calibrated body over those with the true one."""
        return self.calibrated.mpjpe_cm / self.ideal.mpjpe_cm


def evaluate_calibration(
    data: Sequence[Path], folder: Path, grid: Sequence[GridBody] = GRID, stage: StageProgress | None = None
) -> list[CalibrationScore]:
    """Every body of the grid on clips of `data` that are not in the database, which is built into `folder`.

    Raises FileError where the data have too few clips.
    """
    stage = stage or (lambda name: no_progress)
    split = split_by_action(find_clips(data))
    database = kept_database(folder / "without-held-out", split.training, False, stage("database"))
    learning, test = _parted(split.held_out)
    scores, progress = [], stage("calibrating")
    for number, body in enumerate(grid):
        scores.append(_scored(body, database, learning, test))
        progress(number + 1, len(grid))
    return scores


def row_of(score: CalibrationScore) -> dict[str, object]:
    """One body's figures."""
    return {
        "body": score.body.title,
        "ideal_cm": round(score.ideal.mpjpe_cm, 2),
        "ideal_deg": round(score.ideal.euler_deg, 2),
        "calibrated_cm": round(score.calibrated.mpjpe_cm, 2),
        "calibrated_deg": round(score.calibrated.euler_deg, 2),
        "uncalibrated_cm": round(score.plain.mpjpe_cm, 2),
        "ratio": round(score.ratio, 2),
        "length_cm": round(score.length_cm, 2),
        "offset_cm": round(score.offset_cm, 2),
        "seconds": round(score.seconds, 1),
        "verdict": score.result.verdict,
    }


def table_of(scores: Sequence[CalibrationScore]) -> str:
    """A Markdown table, and the mean and worst ratio."""
    lines = [
        "| body | ideal cm / deg | calibrated | ratio | uncalibrated cm | lengths, offsets cm off | s | verdict |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for s in scores:
        lines.append(
            f"| {s.body.title} | {s.ideal.mpjpe_cm:.2f} / {s.ideal.euler_deg:.2f} "
            f"| {s.calibrated.mpjpe_cm:.2f} / {s.calibrated.euler_deg:.2f} | {s.ratio:.2f} | {s.plain.mpjpe_cm:.1f} "
            f"| {s.length_cm:.1f}, {s.offset_cm:.1f} | {s.seconds:.1f} | {s.result.verdict} |"
        )
    ratios = [s.ratio for s in scores]
    return "\n".join([*lines, "", f"ratio: mean {np.mean(ratios):.2f}, worst {max(ratios):.2f}"])


def _parted(held_out: Sequence[Clip]) -> tuple[list[Motion], list[Motion]]:
    """Motions at the database's rate to calibrate on, `MOVE_S` together, and others to test on, of all actions."""
    if len(held_out) < 2:
        raise FileError("one clip is held out; calibration needs two: one to calibrate on, another to test on")
    learning: list[Motion] = []
    for clip in _by_turns(held_out[::2]):
        left = MOVE_S - sum(motion.duration_s for motion in learning)
        if left > 1:
            learning.append(_part(clip, min(CLIP_S, left)))
    return learning, [_part(clip, TEST_S) for clip in _by_turns(held_out[1::2])[:TEST_CLIPS]]


def _by_turns(clips: Sequence[Clip]) -> list[Clip]:
    """One clip of each action, then a second of each, and so on."""
    seen: dict[str, int] = {}
    order = []
    for clip in clips:
        seen[clip.action] = seen.get(clip.action, 0) + 1
        order.append(seen[clip.action])
    return [clips[i] for i in np.argsort(order, kind="stable")]


def _part(clip: Clip, seconds: float) -> Motion:
    """The middle of a clip."""
    motion = read_motion(clip.path)
    length = min(len(motion), round(seconds * motion.fps))
    start = (len(motion) - length) // 2
    return cropped(motion, start, start + length)


def _grounded(motion: Motion) -> Motion:
    """The motion in a room whose floor is at y = 0, which not every clip's is: ankles that carry it stand over that."""
    joints, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    ankles = [motion.skeleton.role_joint(role) for role in ("left_ankle", "right_ankle")]
    at = motion.root_positions.copy()
    standing = np.percentile(joints[:, ankles, 1].min(axis=1), 10)
    at[:, 1] += ANKLE_SHARE * stature(motion.skeleton) - standing
    return replace(motion, root_positions=frozen(at))


def _scored(
    body: GridBody, database: MotionDatabase, learning: Sequence[Motion], test: Sequence[Motion]
) -> CalibrationScore:
    rng = np.random.default_rng(zlib.crc32(replace(body, turn_noise_deg=None).title.encode()))
    known = database.space.skeleton
    scales = {name: 1 + rng.choice([-1, 1]) * body.limb_spread for name in SEGMENTS}
    true = scaled(scaled_to_stature(known, body.stature_m), scales)
    lengths = rng.uniform(0.4, 1.0, (6, 1)) * body.offset_cm / 100
    ways = rng.normal(size=(6, 3))
    turns = exponential(rng.normal(0, 0.7, (6, 3)))
    worn = Mounting(frozen(lengths * ways / np.linalg.norm(ways, axis=1, keepdims=True)), frozen(turns))
    takes = [
        held_t_pose(true, body.rate_hz, rng),
        *(_grounded(retargeted(resampled(m, body.rate_hz), true)) for m in learning),
    ]
    frames = in_one(([tracker_readings(m, worn, body, rng) for m in takes]), _PAUSE_S)
    began = time.process_time()
    result = calibrate(frames, database)
    seconds = time.process_time() - began
    found, profile = result.profile.skeleton(known), result.profile
    kinds: list[list[Accuracy]] = [[], [], []]
    for motion in test:
        truth = _grounded(retargeted(resampled(motion, FPS), true))
        seen = tracker_readings(truth, worn, replace(body, rate_hz=FPS), rng)
        for kind, (skeleton, mounting) in zip(
            kinds, ((true, worn), (found, profile.mounting), (known, None)), strict=True
        ):
            kind.append(accuracy(truth, reconstruct(seen, database, skeleton, mounting=mounting).motion))
    ideal, calibrated, plain = (_mean(kind) for kind in kinds)
    off = 100 * np.abs(_bone_lengths(found) - _bone_lengths(true))
    places = 100 * np.linalg.norm(profile.mounting.offsets - worn.offsets, axis=1)
    return CalibrationScore(body, ideal, calibrated, plain, result, float(off.mean()), float(places.mean()), seconds)


def _bone_lengths(skeleton: Skeleton) -> NDArray[np.float64]:
    """Metres of every bone that is fitted."""
    joints = [skeleton.humanoid[bone] for bones in SEGMENTS.values() for bone in bones if bone in skeleton.humanoid]
    return np.linalg.norm(skeleton.offsets[joints], axis=1)


def _mean(of: Sequence[Accuracy]) -> Accuracy:
    return Accuracy(*(float(np.mean([getattr(a, name) for a in of])) for name in Accuracy.__dataclass_fields__))


_HELD = {
    "hips": 2.0,
    "spine": 2.0,
    "chest": 2.0,
    "neck": 3.0,
    "head": 4.0,
    "shoulder": 3.0,
    "upper_arm": 5.0,
    "lower_arm": 5.0,
    "hand": 7.0,
    "upper_leg": 2.0,
    "lower_leg": 2.0,
    "foot": 3.0,
}
"""Degrees, standard deviation about each axis by which a person who is asked to hold a T-pose is off it (set by us)."""
_SWAY_DEG = 0.4


def held_t_pose(skeleton: Skeleton, rate_hz: float, rng: np.random.Generator) -> Motion:
    """`HOLD_S` of a T-pose as a person holds it: every joint is a little off, and sways.

    It is made from the pose in which characters are bound, whose arms are raised; calibration makes its own another
    way.
    """
    root, rotations = bind_pose(skeleton)
    rotations = rotations.copy()
    bones = skeleton.humanoid
    _, world = world_joints(skeleton, root, rotations)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        joint = bones[f"{side}_upper_arm"]
        own = Rotation.from_matrix(world[joint])
        raise_arm = Rotation.from_rotvec([0.0, 0.0, sign * np.pi / 4])
        rotations[joint] = (Rotation.from_quat(rotations[joint]) * own.inv() * raise_arm * own).as_quat()
    count = round(HOLD_S * rate_hz) + 1
    phase = 2 * np.pi * np.arange(count) / rate_hz
    spread = np.zeros((len(skeleton), 1))
    for bone, joint in bones.items():
        spread[joint] = np.radians(_HELD.get(bone.removeprefix("left_").removeprefix("right_"), 0.0))
    off = exponential(rng.normal(0, 1, (len(skeleton), 3)) * spread)
    sway = np.radians(_SWAY_DEG) * rng.normal(0, 1, (len(skeleton), 3)) * (spread > 0)
    rate, start = rng.uniform(0.2, 0.6, (len(skeleton), 1)), rng.uniform(0, 2 * np.pi, (len(skeleton), 1))
    moving = exponential(sway * np.sin(rate * phase[:, None, None] + start))
    turned = multiply(multiply(np.tile(rotations, (count, 1, 1)), np.tile(off, (count, 1, 1))), moving)
    turned[:, 0] = multiply(np.tile(about_up(rng.uniform(-3, 3, 1)), (count, 1)), turned[:, 0])
    return _grounded(Motion(skeleton, np.tile(root, (count, 1)), turned, rate_hz, "T-pose"))


def tracker_readings(motion: Motion, worn: Mounting, body: GridBody, rng: np.random.Generator) -> list[TrackerFrame]:
    """What trackers worn like that read of a motion, with the body's noise."""
    joints, world = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    roles = [motion.skeleton.role_joint(role) for role in ROLES]
    where = joints[:, roles] + np.einsum("trab,rb->tra", world[:, roles], worn.offsets)
    where = where + rng.normal(0, 1, where.shape) * body.noise_mm / 1000
    turned = np.full((*where.shape[:2], 4), np.nan)
    if body.turn_noise_deg is not None:
        own = Rotation.from_matrix(world[:, roles].reshape(-1, 3, 3)).as_quat().reshape(turned.shape)
        noise = exponential(rng.normal(0, np.radians(body.turn_noise_deg), where.shape))
        turned = multiply(multiply(own, np.tile(worn.rotations, (len(own), 1, 1))), noise)
    states = np.full(len(ROLES), TrackerState.MEASURED, np.int8)
    times = np.arange(len(motion)) / motion.fps
    return [TrackerFrame(float(t), frozen(p), frozen(q), states) for t, p, q in zip(times, where, turned, strict=True)]


def in_one(takes: Sequence[Sequence[TrackerFrame]], pause_s: float) -> list[TrackerFrame]:
    """Takes one after the other with a pause between, in which there are no frames."""
    frames: list[TrackerFrame] = []
    start = 0.0
    for take in takes:
        frames += [replace(frame, time_s=start + frame.time_s) for frame in take]
        start = frames[-1].time_s + pause_s
    return frames
