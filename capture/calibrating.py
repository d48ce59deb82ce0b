"""What `calibrate` does: watch the performer, fit the body, say how good it is."""

import json
import tempfile
import time
from pathlib import Path

import numpy as np

from capture.config import SessionConfig
from capture.going_live import keep_quietly
from capture.library import open_named_database
from capture.progress import progress_bar, tell_all
from devices.sample import ROLES
from reconstruction.calibration import Profile, calibrate
from replay_logs.frames import load_frames

T_POSE_S = 3.0


def calibrate_from_file(take: Path, database: str, height_m: float | None) -> Profile:
    """The profile of whoever is in a take or tracks file. Raises FileError and SettingError."""
    with progress_bar("opening the database") as progress:
        known = open_named_database(database, progress)
    frames = load_frames(take, known.fps, warn=lambda message: tell_all([message]))
    with progress_bar("fitting the body") as progress:
        return calibrate(frames, known, height_m, progress=progress)


def calibrate_from_devices(config: SessionConfig, seconds: float, database: str, height_m: float | None) -> Profile:
    """The profile of whoever wears the trackers now: a T-pose, then free movement, told on the terminal."""
    with tempfile.TemporaryDirectory() as folder:
        take = Path(folder) / "calibration.mcap"
        for left in (3, 2, 1):
            tell_all([f"T-pose in {left}"])
            time.sleep(1)
        tell_all([f"hold the T-pose {T_POSE_S:.0f} s, then move freely for {seconds:.0f} s"])
        keep_quietly(config, take, T_POSE_S + seconds)
        return calibrate_from_file(take, database, height_m)


def report(profile: Profile, path: Path, as_json: bool) -> None:
    """The residual, the verdict, lengths and offsets."""
    offsets_cm = {role: (100 * o).round(2).tolist() for role, o in zip(ROLES, profile.mounting.offsets, strict=True)}
    if as_json:
        figures = {"residual_cm": profile.residual_cm, "verdict": profile.verdict, "scales": profile.scales}
        print(json.dumps(figures | {"offsets_cm": offsets_cm, "out": str(path)}))
        return
    print(f"residual {profile.residual_cm:.2f} cm: {profile.verdict}")
    print("lengths against the database's body: " + ", ".join(f"{n} {s:.3f}" for n, s in profile.scales.items()))
    print("offsets, cm: " + ", ".join(f"{r} {np.linalg.norm(o):.1f}" for r, o in offsets_cm.items()))
    print(f"wrote {path}")
