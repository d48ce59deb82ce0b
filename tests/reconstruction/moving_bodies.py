"""Small made-up motions for tests: a body that stands and breathes, one that walks, one that jumps."""

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.skeleton import Skeleton
from reconstruction.standard_body import standard_skeleton


def _motion(skeleton: Skeleton, turns: dict[str, np.ndarray], path: np.ndarray, fps: float, name: str) -> Motion:
    """A motion from rotation vectors (T, 3) by joint name; its feet touch the floor all along."""
    frames = len(path)
    vectors = np.zeros((frames, len(skeleton), 3))
    for joint, vector in turns.items():
        vectors[:, skeleton.names.index(joint)] = vector
    rotations = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_quat().reshape(frames, len(skeleton), 4)
    joints, _ = world_joints(skeleton, path, rotations)
    path = path - (0, 1, 0) * joints[..., 1].min(axis=1, keepdims=True)
    return Motion(skeleton, path, rotations, fps, name)


def about_x(angle: np.ndarray) -> np.ndarray:
    """Rotation vectors (T, 3) about the body's left."""
    return np.stack([angle, 0 * angle, 0 * angle], axis=-1)


def standing(frames: int, fps: float = 60.0, stature_m: float = 1.75, arms: float = 1.2) -> Motion:
    """Stands with slightly bent knees, arms down by `arms` radians, breathing."""
    skeleton = standard_skeleton(stature_m)
    breath = 0.05 * np.sin(np.arange(frames) / fps * 2)
    ones = np.ones(frames)
    down = np.stack([0 * ones, 0 * ones, -arms * ones + breath], axis=-1)
    turns = {"LeftArm": down, "RightArm": -down, "Spine1": about_x(breath)}
    for side in ("Left", "Right"):
        turns |= {f"{side}UpLeg": about_x(-0.1 * ones), f"{side}Leg": about_x(0.2 * ones)}
        turns[f"{side}Foot"] = about_x(-0.1 * ones)
    return _motion(skeleton, turns, np.zeros((frames, 3)), fps, "standing")


def walking(frames: int, fps: float = 60.0, stature_m: float = 1.75, speed_m_s: float = 1.2) -> Motion:
    """Walks towards +Z, legs swinging a little less than a second a stride."""
    skeleton = standard_skeleton(stature_m)
    t = np.arange(frames) / fps
    turns = {}
    for side, phase in (("Left", 0.0), ("Right", np.pi)):
        swing = 2 * np.pi * 0.9 * t + phase
        turns |= {
            f"{side}UpLeg": about_x(-0.15 - 0.45 * np.sin(swing)),
            f"{side}Leg": about_x(0.45 + 0.35 * np.cos(swing)),
            f"{side}Foot": about_x(-0.2 + 0.1 * np.sin(swing)),
            f"{side}Arm": about_x(0.4 * np.sin(swing)) + np.array([0, 0, -1.2 if side == "Left" else 1.2]),
        }
    path = np.stack([0 * t, 0 * t, speed_m_s * t], axis=-1)
    return _motion(skeleton, turns, path, fps, "walking")


def jumping(frames: int = 90, fps: float = 60.0) -> Motion:
    """Jumps 0.35 m up on the spot, in mid-flight half way through."""
    motion = standing(frames, fps)
    t = (np.arange(frames) - frames / 2) / fps
    rise = np.maximum(0.35 - 9.81 / 2 * t**2, 0)
    path = motion.root_positions + rise[:, None] * (0, 1, 0)
    return Motion(motion.skeleton, path, motion.rotations, fps, "jumping")
