"""Solving a whole take: the file's frames through the reconstruction, with the figures a user wants of it."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from capture.latency import percentiles_ms
from capture.profiles import load_profile
from capture.progress import tell_all
from capture.solve_settings import SolveSettings
from devices.errors import FileError, SettingError, choice_error
from devices.frame import TrackerFrame, frozen
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.database import MotionDatabase
from reconstruction.motion import Motion
from reconstruction.mounting import Mounting
from reconstruction.skeleton import Skeleton
from reconstruction.solution import Reconstruction
from reconstruction.solver import Reconstructor
from reconstruction.stature import scaled_to_stature
from replay_logs.frames import load_frames, take_frames
from replay_logs.retuning import retuned
from replay_logs.take import read_take


@dataclass(frozen=True, eq=False)
class SolvedTake:
    """A take's frames and what became of them."""

    frames: list[TrackerFrame]
    reconstruction: Reconstruction

    @property
    def motion(self) -> Motion:
        """One pose a frame."""
        return self.reconstruction.motion

    def figures(self) -> dict:
        """Poses, seconds of motion, solve milliseconds a frame and mean coverage (about 1 inside the database)."""
        return {
            "poses": len(self.motion),
            "duration_s": round(self.motion.duration_s, 3),
            "solve_ms": percentiles_ms(self.reconstruction.milliseconds),
            "coverage": round(float(np.mean(self.reconstruction.coverage)), 3),
        }


def solve_take(
    take: Path,
    database: MotionDatabase,
    method: str = "default",
    height_m: float | None = None,
    trackers: str | None = None,
    profile: str | Path | None = None,
    progress: Progress = no_progress,
) -> SolvedTake:
    """Every frame of a `.mcap` take or a `.csv` of tracks, solved on a body of that stature (the database's if None).

    method: `default` or `paper`. trackers: the roles to use, with commas between; all where None. profile: a
    performer's name or file of `sixpoint calibrate`, in place of the stature. Raises FileError and SettingError.
    """
    settings = SolveSettings().with_values(performer__height_m=height_m, trackers=trackers)
    settings = settings.with_values(performer__profile=None if profile is None else str(profile), solver__method=method)
    return solve_with(take, database, settings, progress)


def solve_with(
    take: Path, database: MotionDatabase, settings: SolveSettings, progress: Progress = no_progress
) -> SolvedTake:
    """Every frame of a `.mcap` take or a `.csv` of tracks, solved with these settings (their database apart).

    With one thread in numerical libraries, whatever the environment says: sums that several threads share are added up
    in another order, and the same take must give the same bits. Raises FileError and SettingError.
    """
    frames = frames_with(take, database.fps, settings)
    body = _performer_of(database, settings)
    with threadpool_limits(1):
        solver = Reconstructor(database, body.skeleton, settings.solver, mounting=body.mounting)
        return SolvedTake(frames, solver.solve_take(frames, progress))


def frames_with(take: Path, fps: float, settings: SolveSettings) -> list[TrackerFrame]:
    """The frames of a take or of tracks, its devices' filters and the roles as in the settings. Raises FileError where
    no role has a position, and SettingError."""
    if settings.device:
        if take.suffix.lower() == ".csv":
            raise SettingError(f"{take}: tracks have no device whose settings could be changed")
        held = retuned(read_take(take), settings.device)
        tell_all([held.missing] if held.missing else [])
        frames = take_frames(held, fps)
    else:
        frames = load_frames(take, fps, warn=lambda message: tell_all([message]))
    if settings.trackers is not None:
        frames = only_roles(frames, settings.trackers)
    if not any(frame.measured.any() for frame in frames):
        raise FileError(f"{take}: no tracker with a role in it has a position")
    return frames


@dataclass(frozen=True, eq=False)
class Performer:
    """Who is captured: the body, and how the trackers sit on it (in the joints where None)."""

    skeleton: Skeleton
    mounting: Mounting | None = None


def _performer_of(database: MotionDatabase, settings: SolveSettings) -> Performer:
    """As the settings say, by the calibration that a take holds where there is one."""
    if not settings.calibration:
        return performer(database, settings.height_m, settings.profile or None)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{Path(settings.profile).stem}.json"
        path.write_text(settings.calibration, encoding="utf-8")
        return performer(database, profile=path)


def performer(database: MotionDatabase, height_m: float | None = None, profile: str | Path | None = None) -> Performer:
    """The performer of a calibration profile, or the database's body, scaled to a stature where one is given."""
    body = database.space.skeleton
    if profile is not None:
        known = load_profile(profile)
        return Performer(known.skeleton(body), known.mounting)
    return Performer(body if height_m is None else scaled_to_stature(body, height_m))


def only_roles(frames: list[TrackerFrame], trackers: str) -> list[TrackerFrame]:
    """The frames with every other role missing. Raises SettingError for an unknown role or fewer than two."""
    roles = [name.strip() for name in trackers.split(",")]
    for role in roles:
        if role not in ROLES:
            raise choice_error("tracker role", role, ROLES)
    if len(set(roles)) < 2:
        raise SettingError(f"at least two trackers are needed, not only {trackers!r}")
    kept = np.array([role in roles for role in ROLES])
    return [
        TrackerFrame(
            f.time_s,
            frozen(np.where(kept[:, None], f.positions, np.nan)),
            frozen(np.where(kept[:, None], f.orientations, np.nan)),
            frozen(np.where(kept, f.states, 0).astype(np.int8)),
        )
        for f in frames
    ]
