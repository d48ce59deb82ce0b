"""A motion made ready for transitions: what can be known of a clip before anyone asks for a transition."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from devices.frame import frozen
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.motion_operations import resampled
from reconstruction.rotations import inverse, logarithm, multiply, rotate
from reconstruction.skeleton import Skeleton
from reconstruction.transition.arms_clear import body_capsules
from reconstruction.transition.body_mass import mass_weights
from reconstruction.transition.classification import DEFAULT_THRESHOLDS, ClassThresholds, MotionClass, classify

DERIVATIVE_WINDOW_S = 1 / 30
"""Speeds are taken over so long before and after a frame, or one frame: captured frames are noisy."""
FOOT_STILL_M_S = 0.30
"""An ankle slower than this ..."""
FOOT_LOW_M = 0.05
"""... and no higher than this above where it stands is planted."""


GLITCH_M = 0.05


@dataclass(frozen=True, slots=True)
class Leg:
    """Joint indices of one leg. toes: the joints below the ankle, in order outwards."""

    hip: int
    knee: int
    ankle: int
    toes: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TransitionClip:
    """A motion with its class, speeds and footsteps.

    joints: (T, J, 3) metres, world_rotations: (T, J, 4), both world; floor_m: height of the ground it stands on.
    velocities, accelerations: (T, J, 3) rad/s and rad/s^2, of each local rotation in the joint's own axes.
    root_velocity, root_acceleration: (T, 3) m/s and m/s^2; ankle_*: (T, F, 3) the same of the ankles;
    foot_velocity, foot_acceleration: (T, F, 3) of the ankles' world rotations, in their own axes.
    planted: (T, F) whether each foot stands; legs: F of them, left first, none for a skeleton without legs.
    """

    motion: Motion
    motion_class: MotionClass
    legs: tuple[Leg, ...]
    floor_m: float
    joints: NDArray[np.float64]
    world_rotations: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]
    root_velocity: NDArray[np.float64]
    root_acceleration: NDArray[np.float64]
    ankle_velocity: NDArray[np.float64]
    ankle_acceleration: NDArray[np.float64]
    foot_velocity: NDArray[np.float64]
    foot_acceleration: NDArray[np.float64]
    planted: NDArray[np.bool_]
    thresholds: ClassThresholds

    def __len__(self) -> int:
        return len(self.motion)

    @property
    def skeleton(self) -> Skeleton:
        return self.motion.skeleton

    @property
    def fps(self) -> float:
        return self.motion.fps

    @cached_property
    def headings(self) -> NDArray[np.float64]:
        """(T,) radians about +Y from +Z: where hips and shoulders face; the root's own +Z where there are none.

        From joint positions, since joints' own axes differ from skeleton to skeleton.
        """
        bones = self.skeleton.humanoid
        across = np.zeros((len(self), 3))
        for bone in ("upper_leg", "upper_arm"):
            if f"left_{bone}" in bones and f"right_{bone}" in bones:
                side = self.joints[:, bones[f"left_{bone}"]] - self.joints[:, bones[f"right_{bone}"]]
                across += side / np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-9)
        forward = rotate(self.world_rotations[:, 0], np.array([0.0, 0.0, 1.0]))
        upright = np.hypot(across[:, 0], across[:, 2]) > 1e-6
        facing = np.where(upright, np.arctan2(-across[:, 2], across[:, 0]), np.arctan2(forward[:, 0], forward[:, 2]))
        return frozen(facing)

    @cached_property
    def leg_joints(self) -> NDArray[np.int64]:
        """(F, 3) hip, knee and ankle of each leg."""
        return np.array([(leg.hip, leg.knee, leg.ankle) for leg in self.legs], np.int64).reshape(-1, 3)

    @cached_property
    def rotation_range(self) -> NDArray[np.float64]:
        """(2, J, 3) radians: least and greatest rotation vector of each joint, infinite where these wrap around."""
        vectors = logarithm(self.motion.rotations)
        wraps = (np.linalg.norm(vectors, axis=-1) > 0.6 * np.pi).any(axis=0)
        return frozen(
            np.stack(
                (
                    np.where(wraps[:, None], -np.inf, vectors.min(axis=0)),
                    np.where(wraps[:, None], np.inf, vectors.max(axis=0)),
                )
            )
        )

    @cached_property
    def mass_weights(self) -> NDArray[np.float64]:
        """(J,) see `body_mass.mass_weights`."""
        return frozen(mass_weights(self.skeleton))

    @cached_property
    def capsules(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """See `arms_clear.body_capsules`."""
        return body_capsules(self.skeleton)

    def stretch(self, frame: int) -> NDArray[np.float64]:
        """(F,) how far each leg is stretched at a frame: 1 is straight."""
        hip, knee, ankle = self.leg_joints.T
        reach = np.linalg.norm(self.joints[frame, ankle] - self.joints[frame, hip], axis=-1)
        return reach / np.linalg.norm(self.skeleton.offsets[np.stack((knee, ankle))], axis=-1).sum(axis=0)

    @cached_property
    def hinges(self) -> NDArray[np.float64]:
        """(F, 3) m^2: the mean axis about which each knee bends, in the thigh's axes, as long as the bend is strong.

        A little of the body's left is in it: that is where the axis of a leg that is always straight points.
        """
        axes = np.zeros((len(self.legs), 3))
        left = self.joints[:, self.legs[0].hip] - self.joints[:, self.legs[-1].hip] if self.legs else np.zeros(3)
        for f, leg in enumerate(self.legs):
            thigh = self.joints[:, leg.knee] - self.joints[:, leg.hip]
            axis = np.cross(thigh, self.joints[:, leg.ankle] - self.joints[:, leg.knee]) + 0.05 * left
            axes[f] = rotate(inverse(self.world_rotations[:, leg.hip]), axis).mean(axis=0)
        return frozen(axes)

    @cached_property
    def typical_speed(self) -> NDArray[np.float64]:
        """(J,) rad/s: the root mean square of each joint's angular speed."""
        return frozen(np.sqrt((self.velocities**2).sum(axis=-1).mean(axis=0)))

    @cached_property
    def own_acceleration(self) -> float:
        """rad/s^2: the 99th percentile of angular acceleration over all turning joints and frames."""
        return float(np.percentile(self.acceleration_sizes, 99)) if len(self) > 2 else 0.0

    @cached_property
    def acceleration_sizes(self) -> NDArray[np.float64]:
        """(T - 2, turning joints) rad/s^2, by second differences."""
        return frozen(angular_accelerations(self.motion.rotations, self.fps)[:, ~self.skeleton.is_end])

    def at_rate(self, fps: float) -> "TransitionClip":
        """The same clip at another frame rate."""
        moved = resampled(self.motion, fps)
        return (
            self if len(moved) == len(self) and abs(fps - self.fps) < 1e-6 * fps else prepared(moved, self.thresholds)
        )


def prepared(motion: Motion, thresholds: ClassThresholds = DEFAULT_THRESHOLDS) -> TransitionClip:
    """Everything about a motion that its transitions need: world joints, speeds, footsteps, class."""
    skeleton = motion.skeleton
    joints, _ = world_joints(skeleton, motion.root_positions, motion.rotations)
    world = _chained(skeleton, motion.rotations)
    legs = legs_of(skeleton)
    feet = joints[:, [leg.ankle for leg in legs]]
    clearance, floor = _clearance(joints, legs)
    ankles = [leg.ankle for leg in legs]
    velocities, accelerations = angular_derivatives(motion.rotations, motion.fps)
    root_velocity, root_acceleration = derivatives(np.diff(motion.root_positions, axis=0), motion.fps)
    ankle_velocity, ankle_acceleration = derivatives(np.diff(feet, axis=0), motion.fps)
    foot_velocity, foot_acceleration = angular_derivatives(world[:, ankles], motion.fps)
    kind = MotionClass.ON_THE_SPOT
    if legs:
        kind = classify(feet, clearance, joints[:, 0, 1], motion.fps, thresholds)
    return TransitionClip(
        motion=motion,
        motion_class=kind,
        legs=legs,
        floor_m=floor,
        joints=frozen(joints),
        world_rotations=frozen(world),
        velocities=frozen(velocities),
        accelerations=frozen(accelerations),
        root_velocity=frozen(root_velocity),
        root_acceleration=frozen(root_acceleration),
        ankle_velocity=frozen(ankle_velocity),
        ankle_acceleration=frozen(ankle_acceleration),
        foot_velocity=frozen(foot_velocity),
        foot_acceleration=frozen(foot_acceleration),
        planted=frozen(planted_feet(feet, motion.fps)),
        thresholds=thresholds,
    )


def legs_of(skeleton: Skeleton) -> tuple[Leg, ...]:
    """The skeleton's legs, left first; those with hip, knee and ankle only."""
    bones = skeleton.humanoid
    legs = []
    for side in ("left", "right"):
        names = [f"{side}_{bone}" for bone in ("upper_leg", "lower_leg", "foot")]
        if all(name in bones for name in names):
            hip, knee, ankle = (bones[name] for name in names)
            if skeleton.parents[knee] == hip and skeleton.parents[ankle] == knee:
                legs.append(Leg(hip, knee, ankle, tuple(_below(skeleton, ankle))))
    return tuple(legs)


def _below(skeleton: Skeleton, joint: int) -> list[int]:
    return [below for child in skeleton.children[joint] for below in (child, *_below(skeleton, child))]


def _chained(skeleton: Skeleton, rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, J, 4) world rotations of local ones."""
    world = np.empty_like(rotations)
    for joint, parent in enumerate(skeleton.parents):
        local = rotations[:, joint]
        world[:, joint] = local if parent < 0 else multiply(world[:, parent], local)
    return world


def _clearance(joints: NDArray[np.float64], legs: tuple[Leg, ...]) -> tuple[NDArray[np.float64], float]:
    """(T, F) metres of each foot's lowest joint above its own ground level, and the height of the floor.

    The floor is as low as the feet go; a glitch that throws them far down does not count.
    """
    if not legs:
        return np.zeros((len(joints), 0)), 0.0
    lowest = np.stack([joints[:, [leg.ankle, *leg.toes], 1].min(axis=1) for leg in legs], axis=1)
    ground = np.percentile(lowest, 2, axis=0)
    return lowest - ground, float(max(lowest.min(), ground.min() - GLITCH_M))


def planted_feet(feet: NDArray[np.float64], fps: float) -> NDArray[np.bool_]:
    """(T, F) True where an ankle (T, F, 3) is low and hardly moves."""
    if len(feet) < 2 or not feet.shape[1]:
        return np.ones(feet.shape[:2], bool)
    speed = np.linalg.norm(np.gradient(feet, 1 / fps, axis=0), axis=-1)
    low = feet[..., 1] < np.percentile(feet[..., 1], 5, axis=0) + FOOT_LOW_M
    return low & (speed < FOOT_STILL_M_S)


def angular_derivatives(rotations: NDArray[np.float64], fps: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Eq. 1: angular velocities and accelerations (T, ..., 3) of quaternions (T, ..., 4), in their own axes."""
    return derivatives(logarithm(multiply(inverse(rotations[:-1]), rotations[1:])), fps)


def derivatives(steps: NDArray[np.float64], fps: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """First and second derivatives (T, ...) of what goes by `steps` (T - 1, ...) from frame to frame.

    The speed is the mean over the window around a frame; the acceleration the difference between the means over its
    two halves. The first and last steps are repeated outwards.
    """
    half = max(1, round(DERIVATIVE_WINDOW_S * fps))
    if not len(steps):
        return np.zeros((1, *steps.shape[1:])), np.zeros((1, *steps.shape[1:]))
    padded = np.concatenate([steps[:1]] * half + [steps] + [steps[-1:]] * half) * fps
    sums = np.concatenate([np.zeros_like(padded[:1]), np.cumsum(padded, axis=0)])
    means = (sums[half:] - sums[:-half]) / half
    before, after = means[: len(steps) + 1], means[half : half + len(steps) + 1]
    return (before + after) / 2, (after - before) * fps / half


def angular_accelerations(rotations: NDArray[np.float64], fps: float) -> NDArray[np.float64]:
    """(T - 2, ...) rad/s^2, sizes of the angular accelerations of quaternions (T, ..., 4) by second differences."""
    steps = logarithm(multiply(inverse(rotations[:-1]), rotations[1:])) * fps
    return np.linalg.norm(np.diff(steps, axis=0), axis=-1) * fps
