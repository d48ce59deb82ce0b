"""Small motions and a small database of them, made here, for the tests of the reconstruction."""

import numpy as np
import pytest

from reconstruction.database import MotionDatabase, build_database
from reconstruction.motion import Motion
from reconstruction.rotations import about_up, exponential, multiply
from reconstruction.standard_body import standard_skeleton


def strolling(seed: int = 0, frames: int = 150, fps: float = 60.0, stature_m: float = 1.75) -> Motion:
    """A body that turns and goes along while its limbs swing; no gait, but smooth and never twice the same."""
    rng = np.random.default_rng(seed)
    skeleton = standard_skeleton(stature_m)
    time = np.arange(frames) / fps
    phase = 2 * np.pi * (rng.uniform(0.8, 1.1) * time + rng.uniform())
    amplitude = np.random.default_rng(99).uniform(-0.5, 0.5, (len(skeleton), 3)) * ~skeleton.is_end[:, None]
    lag = np.random.default_rng(98).uniform(0, 2 * np.pi, (len(skeleton), 3))
    turns = amplitude * rng.uniform(0.8, 1.2) * np.sin(phase[:, None, None] + lag)
    rotations = exponential(turns)
    yaw = rng.uniform(-3, 3) + rng.uniform(-0.5, 0.5) * time
    rotations[:, 0] = multiply(about_up(yaw), exponential(0.1 * np.sin(phase[:, None] + [0.0, 1.0, 2.0])))
    step = stature_m * rng.uniform(0.5, 0.8) / fps
    along = np.cumsum(step * np.stack((np.sin(yaw), np.cos(yaw)), axis=1), axis=0)
    height = stature_m * (0.53 + 0.01 * np.sin(2 * phase))
    return Motion(skeleton, np.stack((along[:, 0], height, along[:, 1]), axis=1), rotations, fps, f"stroll {seed}")


@pytest.fixture(scope="session")
def database(tmp_path_factory: pytest.TempPathFactory) -> MotionDatabase:
    """Twelve strolls at 60 Hz."""
    folder = tmp_path_factory.mktemp("databases") / "strolls"
    return build_database((strolling(seed) for seed in range(12)), folder)
