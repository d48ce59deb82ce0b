"""What `calibrate` does: guide the performer through a T-pose and free movement, fit the body, say how good it is."""

import json
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

import numpy as np

from capture.config import SessionConfig
from capture.going_live import keep_quietly
from capture.library import open_named_database
from capture.profiles import KnownPerformer, list_profiles
from capture.progress import progress_bar, tell_all
from devices.errors import SettingError
from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.calibration import CalibrationResult, calibrate
from reconstruction.database import MotionDatabase
from reconstruction.t_pose import Stillness, hint
from replay_logs.frames import load_frames


class StepKind(Enum):
    """What a step asks of the performer."""

    READY = "ready"
    """Time to get into place; nothing is kept."""
    HOLD = "hold"
    """Hold still in a T-pose: the seconds count only while it is held."""
    MOVE = "move"
    """Move freely."""


@dataclass(frozen=True)
class CalibrationStep:
    """text: what to show the performer; seconds: how long it takes."""

    text: str
    seconds: float
    kind: StepKind


STEPS = (
    CalibrationStep("Stand upright, legs straight, arms out to the sides: a T-pose", 3.0, StepKind.READY),
    CalibrationStep("Hold the T-pose: keep still, look ahead", 3.0, StepKind.HOLD),
    CalibrationStep("Bend and stretch both elbows, turn your hands, circle your arms", 5.0, StepKind.MOVE),
    CalibrationStep("Lift one knee, then the other; squat a little", 5.0, StepKind.MOVE),
    CalibrationStep("Walk a few steps, turn round, look about, bend forward", 6.0, StepKind.MOVE),
)


@dataclass(frozen=True)
class Prompt:
    """What to show now.

    step: which of `count` steps, from 0; text: what to do; kind: of the step; seconds_left: of the step, held where
    the performer does not do it; hint: what is missing ("raise your left arm ..."), or ""; done: all steps are over.
    """

    step: int
    count: int
    text: str
    kind: StepKind
    seconds_left: float
    hint: str = ""
    done: bool = False


@dataclass(frozen=True, eq=False)
class CalibrationTake:
    """Frames to calibrate from. t_pose_s: first and last second of the T-pose, or None where it must be looked for."""

    frames: tuple[TrackerFrame, ...]
    t_pose_s: tuple[float, float] | None = None


class CalibrationScript:
    """Leads through the steps. It is fed every frame of the session, and has no clock but the frames' own.

    Not thread-safe: feed it and read it on one thread (prompts are values and may cross).
    """

    PATIENCE_S = 20.0
    """A T-pose that is not held by then is taken as it is: perhaps a tracker is missing, or only noisy."""

    def __init__(self, steps: Sequence[CalibrationStep] = STEPS) -> None:
        if not steps:
            raise SettingError("a calibration needs at least one step")
        self.steps = tuple(steps)
        self.restart()

    def restart(self) -> None:
        """From the first step again; what was seen is forgotten."""
        self._step, self._began_s, self._now_s = 0, None, 0.0
        self._held_since_s = float("inf")
        self._stillness = Stillness()
        self._frames: list[TrackerFrame] = []
        self._t_pose_s: tuple[float, float] | None = None
        self._hint = ""

    def feed(self, frame: TrackerFrame) -> Prompt:
        """Takes in a frame, goes on to the next step where this one is over, and tells what to show."""
        if self.finished:
            return self.prompt
        if self._began_s is None:
            self._began_s = frame.time_s
        self._now_s = frame.time_s
        if self.steps[self._step].kind is not StepKind.READY:
            self._frames.append(frame)
        if self.steps[self._step].kind is StepKind.HOLD:
            self._watch(frame)
        if self._left() <= 0:
            self._next(frame.time_s)
        return self.prompt

    @property
    def prompt(self) -> Prompt:
        """What to show now."""
        step = self.steps[min(self._step, len(self.steps) - 1)]
        left = 0.0 if self.finished else max(0.0, self._left())
        number = min(self._step, len(self.steps) - 1)
        return Prompt(number, len(self.steps), step.text, step.kind, left, self._hint, self.finished)

    @property
    def finished(self) -> bool:
        """Whether all steps are over."""
        return self._step >= len(self.steps)

    def take(self) -> CalibrationTake:
        """All that was seen so far, for `CalibrationRun` or `calibrate`."""
        return CalibrationTake(tuple(self._frames), self._t_pose_s)

    def _left(self) -> float:
        """Seconds of this step."""
        step, began = self.steps[self._step], self._began_s
        if began is None:
            return step.seconds
        if step.kind is StepKind.HOLD:
            if self._now_s - began > self.PATIENCE_S:
                return 0.0
            return step.seconds - max(0.0, self._now_s - self._held_since_s)
        return step.seconds - (self._now_s - began)

    def _watch(self, frame: TrackerFrame) -> None:
        """Since when the T-pose is held, and what is missing to it."""
        self._stillness.add(frame)
        self._hint = hint(self._stillness.positions)
        still_since = max(self._stillness.since_s, self._began_s or 0.0)
        if self._hint:
            self._held_since_s = float("inf")
        elif self._held_since_s == float("inf") and still_since <= frame.time_s:
            self._held_since_s = frame.time_s
        if still_since > self._held_since_s:
            self._hint, self._held_since_s = "keep still", still_since

    def _next(self, time_s: float) -> None:
        if self.steps[self._step].kind is StepKind.HOLD:
            since = self._held_since_s if self._held_since_s < time_s else time_s - self.steps[self._step].seconds
            self._t_pose_s = (since, time_s)
        self._step += 1
        self._began_s, self._hint = time_s, ""


class CalibrationRun:
    """Calibrating on a thread of its own, so that the session goes on meanwhile."""

    def __init__(self, take: CalibrationTake, database: MotionDatabase, stature_m: float | None = None) -> None:
        """Starts at once. stature_m: the performer's height where it is known."""
        self._done, self._total = 0, 1
        self._result: CalibrationResult | None = None
        self._failure: Exception | None = None
        self._thread = threading.Thread(
            target=self._work, args=(take, database, stature_m), name="calibration", daemon=True
        )
        self._thread.start()

    @property
    def fraction(self) -> float:
        """How much is done, 0 to 1."""
        return self._done / max(self._total, 1)

    @property
    def finished(self) -> bool:
        """Whether `result` would not wait."""
        return not self._thread.is_alive()

    def result(self) -> CalibrationResult:
        """What was found; waits for it. Raises the SettingError that `calibrate` raised."""
        self._thread.join()
        if self._failure is not None:
            raise self._failure
        assert self._result is not None
        return self._result

    def _work(self, take: CalibrationTake, database: MotionDatabase, stature_m: float | None) -> None:
        try:
            self._result = calibrate(take.frames, database, stature_m, take.t_pose_s, self._progress)
        except Exception as error:
            self._failure = error

    def _progress(self, done: int, total: int) -> None:
        self._done, self._total = done, total


def calibrate_from_file(take: Path, database: str, height_m: float | None) -> CalibrationResult:
    """The calibration of whoever is in a take or tracks file. Raises FileError and SettingError."""
    with progress_bar("opening the database") as progress:
        known = open_named_database(database, progress)
    frames = load_frames(take, known.fps, warn=lambda message: tell_all([message]))
    with progress_bar("fitting the body") as progress:
        return calibrate(frames, known, height_m, progress=progress)


def calibrate_from_devices(
    config: SessionConfig, seconds: float, database: str, height_m: float | None
) -> CalibrationResult:
    """The calibration of whoever wears the trackers now, told at the terminal. Raises DeviceError, SettingError, and
    KeyboardInterrupt where it was ended before its time.

    seconds: of free movement, over which the steps of `STEPS` are spread.
    """
    moving = sum(step.seconds for step in STEPS if step.kind is StepKind.MOVE)
    stretch = seconds / moving
    steps = [replace(s, seconds=s.seconds * stretch) if s.kind is StepKind.MOVE else s for s in STEPS]
    with tempfile.TemporaryDirectory() as folder:
        take = Path(folder) / "calibration.mcap"
        planned_s, began_s = sum(step.seconds for step in steps), time.monotonic()
        with _told(steps):
            keep_quietly(config, take, planned_s)
        if time.monotonic() - began_s < planned_s:  # a recording may be cut short, a calibration is then none
            raise KeyboardInterrupt
        return calibrate_from_file(take, database, height_m)


@contextmanager
def _told(steps: Sequence[CalibrationStep]) -> Iterator[None]:
    """Says each step at the terminal when its time has come."""
    timers, at = [], 0.0
    for step in steps:
        timers.append(threading.Timer(at, tell_all, [[f"{step.text} ({step.seconds:.0f} s)"]]))
        at += step.seconds
    for timer in timers:
        timer.start()
    try:
        yield
    finally:
        for timer in timers:
            timer.cancel()


def report(result: CalibrationResult, path: Path, as_json: bool) -> None:
    """Verdict, advice, and a table of lengths and offsets with how well each is known."""
    profile, known = result.profile, result.deviations_cm
    lengths = {name: scale for name, scale in profile.scales.items() if name != "stature"}
    offsets = {r: 100 * o for r, o in zip(ROLES, profile.mounting.offsets, strict=True) if r in result.residuals_cm}
    if as_json:
        figures = {
            "verdict": result.verdict,
            "grade": result.grade.value,
            "advice": list(result.advice),
            "height_m": round(profile.height_m, 3),
            "residual_cm": profile.residual_cm,
            "residuals_cm": result.residuals_cm,
            "deviations_cm": known,
            "scales": profile.scales,
            "offsets_cm": {role: offset.round(2).tolist() for role, offset in offsets.items()},
            "t_pose_s": result.t_pose_s,
            "out": str(path),
        }
        print(json.dumps(figures))
        return
    print(result.verdict)
    for line in result.advice:
        print(f"  {line}")
    print(f"height {profile.height_m:.2f} m; lengths against the database's proportions, with their deviations:")
    print("  " + ", ".join(f"{n} {100 * s - 100:+.1f} % ({known[n]:.1f} cm)" for n, s in lengths.items()))
    print("trackers: distance from the joint, its deviation, what is left over, cm:")
    for role, offset in offsets.items():
        print(f"  {role:12} {np.linalg.norm(offset):5.1f} {known[role]:5.1f} {result.residuals_cm[role]:5.1f}")
    print(f"wrote {path}")


def report_profiles(as_json: bool) -> None:
    """The named profiles with height, day and verdict."""
    performers = list_profiles()
    if as_json:
        print(json.dumps([_row(performer) for performer in performers]))
        return
    if not performers:
        print("no performers yet; make one with 'sixpoint calibrate --name NAME'")
    for p in performers:
        height = "  -   " if np.isnan(p.profile.height_m) else f"{p.profile.height_m:.2f} m"
        print(f"{p.name:16} {height}  {p.profile.made or '-':10}  {p.profile.verdict}")


def _row(performer: KnownPerformer) -> dict[str, object]:
    profile = performer.profile
    height = None if np.isnan(profile.height_m) else round(profile.height_m, 3)
    return {"name": performer.name, "height_m": height, "made": profile.made, "verdict": profile.verdict}
