"""Many takes solved and scored, each by itself: what to do, what came of it, and what is there already."""

import csv
import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Literal

import numpy as np

from capture.accuracy import SKIPPED_S, accuracy
from capture.comparing import solution_figures
from capture.export import write_motion
from capture.library import open_named_database
from capture.solve_settings import apply_settings, settings_for
from capture.solving import solve_with
from devices.errors import FileError, SettingError, SixpointError
from reconstruction.database import MotionDatabase
from reconstruction.motion import Motion
from reconstruction.motion_files import MOTION_ENDINGS, read_motion
from reconstruction.motion_operations import cropped, resampled
from replay_logs.atomic_file import written_beside

TAKE_ENDINGS = (".mcap", ".csv")
SCORES = ("euler_deg", "geodesic_deg", "mpjpe_cm", "tracked_cm", "jitter_ratio", "slide_cm_s", "missing_s")
"""Columns of the results that a true motion is needed for; the errors are those of `capture.accuracy`."""
COLUMNS = (
    "take", "status", "poses", "duration_s", "seconds", "solve_ms_p50", "solve_ms_p99", "coverage", "jitter_m_s3",
    *SCORES, "out", "error",
)  # fmt: skip

Status = Literal["solved", "kept", "failed"]


@dataclass(frozen=True)
class Job:
    """One take to solve. Plain values only, so that it can go to another process or machine.

    out: the motion to write; a file of the same name ending in .json keeps the figures beside it. truth: the true
    motion, where there is one. given: session keys as `SolveSettings.with_values` takes them; changes: `key=value`.
    """

    take: str
    out: str
    truth: str | None = None
    given: Mapping[str, object] = field(default_factory=dict)
    changes: tuple[str, ...] = ()
    joint_names: str | None = None

    @property
    def result(self) -> Path:
        """Where the figures are kept."""
        out = Path(self.out)
        return out.with_name(f"{out.name}.json")

    def fingerprint(self) -> str:
        """Of all that the result follows from; a result that has it need not be made again. Raises FileError."""
        said = {name: value for name, value in asdict(self).items() if name not in ("take", "out", "truth")}
        named = [self.take, self.truth, *(path for path in self.given.values() if isinstance(path, str))]
        files = [_state(path) for path in named if path is not None and (path == self.take or Path(path).exists())]
        return hashlib.sha256(json.dumps([version("sixpoint"), said, files], sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class Outcome:
    """What came of a job. values: by the names in `COLUMNS`."""

    take: str
    status: Status
    values: Mapping[str, object] = field(default_factory=dict)
    error: str = ""

    def row(self) -> dict[str, object]:
        """As a row of the results."""
        return {"take": self.take, **self.values, "status": self.status, "error": self.error}


def planned(
    paths: Sequence[Path],
    out: Path,
    truth: Path | None = None,
    ending: str = ".bvh",
    given: Mapping[str, object] | None = None,
    changes: Sequence[str] = (),
    joint_names: str | None = None,
) -> list[Job]:
    """A job for each take among the paths and anywhere in their folders; where they lie in these, the motions will in
    `out`. Raises FileError for a path that does not exist and where there are no takes."""
    found = dict(entry for path in paths for entry in _takes(path))
    if not found:
        raise FileError(f"{', '.join(map(str, paths))}: no takes here; they end in {' or '.join(TAKE_ENDINGS)}")
    stems = [relative.with_suffix("") for relative in found.values()]
    jobs = []
    for take, relative in found.items():
        alone = stems.count(relative.with_suffix("")) == 1
        place = out / (relative.with_suffix(ending) if alone else relative.with_name(relative.name + ending))
        true = _truth(truth, relative) if truth else None
        names = (str(take.resolve()), str(place.resolve()), str(true.resolve()) if true else None)
        jobs.append(Job(*names, dict(given or {}), tuple(changes), joint_names))
    places = [job.out for job in jobs]
    twice = [job.take for job in jobs if places.count(job.out) > 1]
    if twice:
        raise SettingError(f"these would be written to one place: {', '.join(twice)}; give the folder that holds them")
    return jobs


def _takes(path: Path) -> list[tuple[Path, Path]]:
    """(take, where it lies in the folder that was given)."""
    if path.is_dir():
        files = sorted(file for file in path.rglob("*") if file.suffix.lower() in TAKE_ENDINGS)
        return [(file, file.relative_to(path)) for file in files if not file.name.startswith(".")]
    if not path.exists():
        raise FileError(f"{path}: no such file or folder")
    return [(path, Path(path.name))]


def _truth(folder: Path, relative: Path) -> Path | None:
    """The true motion of a take: at its place in the folder, or of its name right in it."""
    places = (folder / relative, folder / relative.name)
    return next((p for place in places for e in MOTION_ENDINGS if (p := place.with_suffix(e)).is_file()), None)


def kept(job: Job) -> Outcome | None:
    """What came of the job before, where that still holds."""
    try:
        result = json.loads(job.result.read_text(encoding="utf-8"))
        if result["fingerprint"] == job.fingerprint() and Path(job.out).is_file():
            return Outcome(job.take, "kept", result["values"], result["error"])
    except (OSError, ValueError, KeyError, TypeError, SixpointError):
        pass
    return None


def solve_job(job: Job) -> Outcome:
    """Does it; what is wrong with a take is told in the outcome, not raised."""
    try:
        return _solved(job)
    except (SixpointError, OSError) as error:
        return failed(job, str(error))
    except Exception as error:  # one take must not end the others, whatever is wrong with it
        return failed(job, f"{type(error).__name__}: {error}")


def failed(job: Job, error: str) -> Outcome:
    """Nothing came of it, in one line why."""
    return Outcome(job.take, "failed", {}, " ".join(error.split()))


def _solved(job: Job) -> Outcome:
    fingerprint = job.fingerprint()
    began = time.perf_counter()
    settings = apply_settings(settings_for(Path(job.take), job.given), job.changes)
    solved = solve_with(Path(job.take), _database(settings.database), settings)
    seconds = time.perf_counter() - began
    figures = solution_figures(solved)
    times = figures.pop("solve_ms")
    values = {**figures, "seconds": round(seconds, 3), "solve_ms_p50": times["p50"], "solve_ms_p99": times["p99"]}
    values["out"], error = job.out, ""
    if job.truth is not None:
        try:
            values |= scored(read_motion(job.truth), solved.motion)
        except SixpointError as reason:
            error = f"not scored: {reason}"
    Path(job.out).parent.mkdir(parents=True, exist_ok=True)
    write_motion(solved.motion, job.out, joint_names=job.joint_names)
    kept_values = {"fingerprint": fingerprint, "values": values, "error": error}
    with written_beside(job.result) as part:
        part.write_text(json.dumps(kept_values, indent=1), encoding="utf-8")
    return Outcome(job.take, "solved", values, error)


def scored(truth: Motion, solved: Motion) -> dict[str, float]:
    """The errors of a solved motion that began with the true one. missing_s: what it lacks at the end.

    Raises SettingError where the joints differ or there is less than half a second in common.
    """
    true = resampled(truth, solved.fps)
    length = min(len(true), len(solved))
    if length < 2 * SKIPPED_S * solved.fps:
        raise SettingError(f"{truth.name}: only {length} frames to score")
    errors = asdict(accuracy(cropped(true, 0, length), cropped(solved, 0, length)))
    missing_s = max(0.0, true.duration_s - solved.duration_s)
    return {
        name: round(float(value), 4) for name, value in {**errors, "missing_s": missing_s}.items() if name in SCORES
    }


@lru_cache(2)
def _database(name: str) -> MotionDatabase:
    return open_named_database(name)


def _state(path: str) -> list[object]:
    try:
        state = Path(path).stat()
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}") from None
    return [path, state.st_size, state.st_mtime_ns]


def write_results(outcomes: Sequence[Outcome], folder: Path) -> dict:
    """Writes `results.csv`, a row a take, and `summary.json`; gives the summary."""
    folder.mkdir(parents=True, exist_ok=True)
    with written_beside(folder / "results.csv") as part, part.open("w", newline="", encoding="utf-8") as file:
        table: csv.DictWriter[str] = csv.DictWriter(file, COLUMNS, extrasaction="ignore", lineterminator="\n")
        table.writeheader()
        table.writerows(outcome.row() for outcome in outcomes)
    summary = summarised(outcomes)
    with written_beside(folder / "summary.json") as part:
        part.write_text(json.dumps(summary, indent=1), encoding="utf-8")
    return summary


def summarised(outcomes: Sequence[Outcome]) -> dict:
    """How many of each status, minutes of motion, and mean and worst of the figures."""
    counts = {status: sum(o.status == status for o in outcomes) for status in ("solved", "kept", "failed")}
    done = [o for o in outcomes if o.status != "failed"]
    columns = [
        name for name in ("coverage", "jitter_m_s3", "solve_ms_p50", *SCORES) if any(name in o.values for o in done)
    ]
    figures = {}
    for name in columns:
        known = {o.take: float(o.values[name]) for o in done if name in o.values}  # type: ignore[arg-type]
        worst = max(known, key=known.__getitem__)
        mean = round(float(np.mean(list(known.values()))), 4)
        figures[name] = {"mean": mean, "worst": known[worst], "worst_take": worst, "takes": len(known)}
    minutes = sum(float(o.values["duration_s"]) for o in done) / 60  # type: ignore[arg-type]
    broken = {o.take: o.error for o in outcomes if o.status == "failed"}
    return {"takes": len(outcomes), **counts, "minutes": round(minutes, 3), "figures": figures, "failures": broken}
