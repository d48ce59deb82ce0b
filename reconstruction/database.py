"""The motion database: many motions on one joint tree, in pose coordinates, in memory-mapped arrays with an index.

A database is a folder: `manifest.json` (format, version, skeleton, clips, shapes), one `.npy` an array, and the
neighbour index. It is written beside its place and renamed into it. Motions of several body sizes may share one
database: their angles are kept as they are, their root positions are scaled to the leg length of the database's
body, which has the mean proportions of all of them.
"""

import json
import mmap
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from devices.errors import FileError
from devices.progress import Progress, no_progress
from devices.sample import ROLES
from reconstruction.body_kinematics import Body, joint_positions
from reconstruction.motion import Motion
from reconstruction.motion_operations import leg_length, mirrored, require_same_joints, resampled
from reconstruction.neighbours import NeighbourIndex
from reconstruction.pose_space import MeanRotations, PoseSpace
from reconstruction.skeleton import Skeleton
from reconstruction.window_features import SPAN, WindowFeatures, seen_from

FORMAT = "sixpoint motion database"
VERSION = 3
_ARRAYS = ("poses", "headings", "tracks", "windows", "bounds", "feature_mean", "feature_basis")


@dataclass(frozen=True)
class Clip:
    """One motion of a database: rows `first` to `first + frames`; no window crosses the ends."""

    name: str
    first: int
    frames: int


@dataclass(frozen=True, eq=False)
class MotionDatabase:
    """N poses of D coordinates in clips.

    space: the pose space, on the database's mean body.
    fps: frames a second.
    poses: (N, D) float32, each seen from its own heading frame.
    headings: (N, 3) float32, x, z metres and yaw radians of each pose's heading frame in its clip's world.
    tracks: (N, 6, 3) float32 metres, the joints that tracker roles sit on, seen from the own heading frame.
    windows: (W,) int32, rows that have a whole window of history before them, in the order of the index.
    bounds: (D, 2) float32, the joint limits seen in the data, widened.
    spacing: metres, the typical distance of a window to its nearest ones in other moments.
    """

    path: Path
    space: PoseSpace
    fps: float
    clips: tuple[Clip, ...]
    poses: NDArray[np.float32]
    headings: NDArray[np.float32]
    tracks: NDArray[np.float32]
    windows: NDArray[np.int32]
    bounds: NDArray[np.float32]
    features: WindowFeatures
    index: NeighbourIndex
    spacing: float

    def __len__(self) -> int:
        return len(self.poses)

    @cached_property
    def firsts(self) -> NDArray[np.int64]:
        """(C,) first rows of the clips."""
        return np.array([clip.first for clip in self.clips])

    def clip_of(self, row: int) -> Clip:
        """The clip that a row belongs to."""
        return self.clips[int(np.searchsorted(self.firsts, row, side="right")) - 1]

    def motion(self, clip: Clip) -> Motion:
        """One clip, on the database's body."""
        rows = slice(clip.first, clip.first + clip.frames)
        poses, headings = self.poses[rows].astype(np.float64), self.headings[rows].astype(np.float64)
        return self.space.motion(poses, headings, self.fps, clip.name)

    def info(self) -> dict[str, object]:
        """What is inside, for `sixpoint database info`."""
        return {
            "path": str(self.path),
            "poses": len(self),
            "clips": len(self.clips),
            "minutes": round(len(self) / self.fps / 60, 2),
            "fps": self.fps,
            "joints": len(self.space.skeleton),
            "moving_joints": len(self.space.moving),
            "degrees_of_freedom": self.space.dof,
            "windows": len(self.windows),
            "spacing_cm": round(100 * self.spacing, 3),
            "megabytes": round(sum(f.stat().st_size for f in self.path.rglob("*")) / 1e6, 1),
        }


def build_database(
    motions: Iterable[Motion],
    out: str | Path,
    fps: float = 60.0,
    mirror: bool = False,
    progress: Progress = no_progress,
    count: int | None = None,
) -> MotionDatabase:
    """Indexes motions of one joint tree into a database at `out`, an empty or absent folder or an older database.

    The motions are resampled to `fps`; with `mirror` each is there a second time, left and right exchanged. One
    motion at a time is held in memory. `count` is how many motions there are, where that is known, for the progress
    alone. Raises FileError where there is no motion, where joints differ (naming the
    motion and the joints), or where `out` is something else.
    """
    out = Path(out)
    _refuse_foreign(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    beside = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
    try:
        _Builder(beside, fps, mirror, _Stages(progress, count)).build(motions)
        if out.exists():
            shutil.rmtree(out)
        beside.chmod(0o755)
        beside.rename(out)
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise
    return open_database(out)


def open_database(path: str | Path) -> MotionDatabase:
    """Opens a database; what frames will look at is in memory then. Raises FileError where it is none, another
    version's, or broken."""
    path = Path(path)
    manifest = _read_manifest(path)
    arrays = {name: _open_array(path, name, manifest["shapes"][name]) for name in _ARRAYS}
    for name in ("poses", "headings", "tracks", "windows"):
        _page_in(arrays[name])
    body = manifest["skeleton"]
    skeleton = Skeleton(
        tuple(body["names"]), np.array(body["parents"], np.int32), np.array(body["offsets"], np.float64)
    )
    try:
        index = NeighbourIndex.read(path / "index.faiss")
    except RuntimeError:
        raise FileError(f"{path / 'index.faiss'}: missing or cut off; build the database again") from None
    if len(index) != len(arrays["windows"]):
        raise FileError(f"{path / 'index.faiss'}: not this database's index; build the database again")
    return MotionDatabase(
        path=path,
        space=PoseSpace(skeleton, np.array(body["mean"], np.float64), np.array(body["moving"], np.int32)),
        fps=manifest["fps"],
        clips=tuple(Clip(*clip) for clip in manifest["clips"]),
        features=WindowFeatures(
            manifest["turn_weight"],
            manifest["velocity_weight"],
            manifest["tracker_weight"],
            np.array(arrays.pop("feature_mean")),
            np.array(arrays.pop("feature_basis")),
        ),
        index=index,
        spacing=manifest["spacing"],
        **arrays,
    )


def _read_manifest(path: Path) -> dict:
    if not path.exists():
        raise FileError(f"{path}: no such database; build one with 'sixpoint database build'")
    if not (path / "manifest.json").is_file():
        raise FileError(f"{path}: not a motion database (a folder with a manifest.json)")
    try:
        manifest = json.loads((path / "manifest.json").read_text())
    except ValueError:
        raise FileError(f"{path / 'manifest.json'}: not JSON; build the database again") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise FileError(f"{path}: not a motion database")
    if manifest.get("version") != VERSION:
        raise FileError(f"{path}: version {manifest.get('version')}, this program reads {VERSION}; build it again")
    return manifest


def _open_array(path: Path, name: str, shape: list[int]) -> NDArray:
    file = path / f"{name}.npy"
    try:
        array = np.load(file, mmap_mode="r")
    except (OSError, ValueError):
        raise FileError(f"{file}: missing or cut off; build the database again") from None
    if list(array.shape) != shape:
        raise FileError(f"{file}: shape {array.shape}, the manifest says {tuple(shape)}; build the database again")
    return array


def _page_in(array: NDArray) -> None:
    """Touches every page of a mapped file, so that no frame waits for the disk."""
    np.asarray(array).reshape(-1).view(np.uint8)[:: mmap.PAGESIZE].max()


def _refuse_foreign(out: Path) -> None:
    if out.is_file() or (out.is_dir() and any(out.iterdir()) and not (out / "manifest.json").is_file()):
        raise FileError(f"{out}: is there already and is not a motion database; name another place")


@dataclass(frozen=True)
class _Stages:
    """Progress over three stages of about the same length: reading, coordinates, indexing; in per mille of all."""

    progress: Progress
    count: int | None

    def read(self, motions: int) -> None:
        if self.count:
            self.progress(333 * motions // self.count, 1000)

    def placed(self, rows: int, total: int) -> None:
        self.progress(333 + 333 * rows // total, 1000)

    def indexed(self, rows: int, total: int) -> None:
        self.progress(667 + 333 * rows // total, 1000)


class _Builder:
    """Builds a database in two passes: the motions to plain rotations on disk, then those to coordinates."""

    SAMPLE = 20_000
    """Windows that the principal components and the spacing are measured on."""
    LIMIT_MARGIN = 0.35
    """Radians by which joint limits are wider than what the data shows."""

    def __init__(self, folder: Path, fps: float, mirror: bool, stages: _Stages):
        self.folder, self.fps, self.mirror, self.stages = folder, fps, mirror, stages
        self.clips: list[Clip] = []
        self.rows = 0

    def build(self, motions: Iterable[Motion]) -> None:
        space = self._gather(motions)
        self._coordinates(space)
        self._index(space)

    def _gather(self, motions: Iterable[Motion]) -> PoseSpace:
        """First pass: rotations and scaled root positions to disk, the mean rotations and the mean body."""
        means: MeanRotations | None = None
        offsets = np.zeros(0)
        with open(self.folder / "raw.bin", "wb") as raw:
            for motion in self._versions(motions):
                if means is None:
                    means, offsets = MeanRotations(motion.skeleton), np.zeros_like(motion.skeleton.offsets)
                _check_tree(means.skeleton, motion)
                means.add(motion.rotations)
                offsets = offsets + len(motion) * motion.skeleton.offsets
                scaled = motion.root_positions / leg_length(motion.skeleton)
                rows = np.concatenate((scaled, motion.rotations.reshape(len(motion), -1)), axis=1)
                raw.write(rows.astype(np.float32).tobytes())
                self.clips.append(Clip(motion.name, self.rows, len(motion)))
                self.rows += len(motion)
        if means is None:
            raise FileError("no motion to build a database from: name BVH or AMC files, or folders that hold some")
        body = Skeleton(means.skeleton.names, means.skeleton.parents, offsets / self.rows)
        return means.pose_space().with_skeleton(body)

    def _versions(self, motions: Iterable[Motion]) -> Iterator[Motion]:
        """Every motion at the database's rate, and its mirror image where asked for."""
        for number, motion in enumerate(motions):
            self.stages.read(number + 1)
            once = resampled(motion, self.fps)
            yield once
            if self.mirror:
                yield mirrored(once)

    def _coordinates(self, space: PoseSpace) -> None:
        """Second pass: poses, heading frames, tracked joints and all joint positions, clip by clip; joint limits."""
        joints = len(space.skeleton)
        body, scale = Body.of(space), leg_length(space.skeleton)
        tracked = [space.skeleton.role_joint(role) for role in ROLES]
        least, most = np.full(space.dof, np.inf), np.full(space.dof, -np.inf)
        with ExitStack() as open_files:
            raw = open_files.enter_context(open(self.folder / "raw.bin", "rb"))
            shapes = {"poses": (space.dof,), "headings": (3,), "tracks": (len(ROLES), 3), "points": (joints, 3)}
            files = {n: open_files.enter_context(self._rows_file(n, shape)) for n, shape in shapes.items()}
            for clip in self.clips:
                rows = np.fromfile(raw, np.float32, clip.frames * (3 + 4 * joints)).reshape(clip.frames, -1)
                root = scale * rows[:, :3].astype(np.float64)
                rotations = rows[:, 3:].astype(np.float64).reshape(clip.frames, joints, 4)
                own = space.heading(root, rotations[:, 0])
                q = space.coordinates(root, rotations, own)
                own[:, :2] -= own[0, :2].copy()
                own[:, 2] = np.unwrap(own[:, 2])
                points = joint_positions(body, q)
                parts = {"poses": q, "headings": own, "tracks": points[:, tracked], "points": points}
                for name, part in parts.items():
                    part.astype(np.float32).tofile(files[name])
                least, most = np.minimum(least, q.min(axis=0)), np.maximum(most, q.max(axis=0))
                self.stages.placed(clip.first + clip.frames, self.rows)
        (self.folder / "raw.bin").unlink()
        limits = np.stack((least - self.LIMIT_MARGIN, most + self.LIMIT_MARGIN), axis=1)
        np.save(self.folder / "bounds.npy", limits.astype(np.float32))

    def _index(self, space: PoseSpace) -> None:
        """Third pass: features of every window, their index, the spacing and the manifest."""
        starts = [np.arange(c.first + SPAN, c.first + c.frames) for c in self.clips if c.frames > SPAN]
        if not starts:
            raise FileError(f"no motion is longer than {SPAN} frames at {self.fps:g} frames a second")
        windows = np.concatenate(starts).astype(np.int32)
        history = _History(self.folder)
        rng = np.random.default_rng(0)
        sample = np.sort(rng.choice(windows, min(self.SAMPLE, len(windows)), replace=False))
        features = WindowFeatures.fitted(*history.of(sample))
        trainers = np.sort(rng.choice(windows, NeighbourIndex.sample_size(len(windows)), replace=False))
        index = NeighbourIndex.trained(
            np.concatenate([history.features(features, part) for part in _parts(trainers)]), len(windows)
        )
        for part in _parts(windows):
            index.add(history.features(features, part))
            self.stages.indexed(len(index), len(windows))
        index.write(self.folder / "index.faiss")
        probes = sample[:: max(1, len(sample) // 400)]
        spacing = _spacing(index, windows, probes, history.features(features, probes))
        (self.folder / "points.npy").unlink()
        np.save(self.folder / "windows.npy", windows)
        np.save(self.folder / "feature_mean.npy", features.mean)
        np.save(self.folder / "feature_basis.npy", features.basis)
        self._write_manifest(space, features, spacing)

    def _write_manifest(self, space: PoseSpace, features: WindowFeatures, spacing: float) -> None:
        skeleton = space.skeleton
        manifest = {
            "format": FORMAT,
            "version": VERSION,
            "fps": self.fps,
            "spacing": spacing,
            "turn_weight": features.turn_weight,
            "velocity_weight": features.velocity_weight,
            "tracker_weight": features.tracker_weight,
            "skeleton": {
                "names": list(skeleton.names),
                "parents": skeleton.parents.tolist(),
                "offsets": skeleton.offsets.tolist(),
                "mean": space.mean.tolist(),
                "moving": space.moving.tolist(),
            },
            "shapes": {name: list(self._old(name).shape) for name in _ARRAYS},
            "clips": [[c.name, c.first, c.frames] for c in self.clips],
        }
        (self.folder / "manifest.json").write_text(json.dumps(manifest))

    @contextmanager
    def _rows_file(self, name: str, shape: tuple[int, ...]) -> Iterator[IO[bytes]]:
        """An .npy file for one float32 array of that shape a row, its header written: the rows are appended."""
        with open(self.folder / f"{name}.npy", "wb") as file:
            header = {"descr": "<f4", "fortran_order": False, "shape": (self.rows, *shape)}
            np.lib.format.write_array_header_1_0(file, header)
            yield file

    def _old(self, name: str) -> NDArray:
        return np.load(self.folder / f"{name}.npy", mmap_mode="r")


@dataclass(frozen=True)
class _History:
    """Features of rows of a database that is being built. Files are mapped anew for each call, so that no more of
    them is held in memory than one call looks at."""

    folder: Path

    def of(self, rows: NDArray[np.int32]) -> tuple[NDArray, NDArray, NDArray]:
        """Turns one frame before rows (n,), and joint positions one and `SPAN` frames before them, all seen from the
        heading frame of the row before."""
        points, headings = self._mapped("points"), self._mapped("headings")
        earlier = seen_from(points[rows - SPAN], headings[rows - SPAN], headings[rows - 1])
        return self._mapped("poses")[rows - 1][:, 3:], points[rows - 1], earlier

    def features(self, features: WindowFeatures, rows: NDArray[np.int32]) -> NDArray[np.float32]:
        """(n, F) of the windows at rows (n,)."""
        tracks, headings = self._mapped("tracks"), self._mapped("headings")
        trackers = seen_from(tracks[rows], headings[rows], headings[rows - 1])
        return features.features(*self.of(rows), trackers)

    def _mapped(self, name: str) -> NDArray[np.float32]:
        return np.load(self.folder / f"{name}.npy", mmap_mode="r")


def _parts(rows: NDArray[np.int32], size: int = 4096) -> list[NDArray[np.int32]]:
    """Rows in runs of about that many, so that memory stays bounded."""
    return np.array_split(rows, max(1, len(rows) // size))


def _spacing(index: NeighbourIndex, windows: NDArray, rows: NDArray, features: NDArray[np.float32]) -> float:
    """Median distance, metres, from windows (n,) to the nearest that are at least half a second away from them."""
    apart = 30
    nearest = []
    for row, feature in zip(rows, features, strict=True):
        numbers, distances = index.nearest(feature, 128)
        elsewhere = distances[np.abs(windows[numbers] - row) > apart]
        nearest.append(elsewhere[0] if len(elsewhere) else distances[-1])
    return max(float(np.median(nearest)), 1e-3)


def _check_tree(skeleton: Skeleton, motion: Motion) -> None:
    """One database has one joint tree."""
    require_same_joints(skeleton, motion.skeleton, motion.name)
    if not skeleton.same_tree(motion.skeleton):
        raise FileError(f"{motion.name}: its joints come in another order than in the motions before it")
