"""The figures of transitions on given motions: ours beside the paper's and what games do (docs/transitions.md)."""

import re
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from devices.errors import FileError, SixpointError
from devices.progress import Progress, no_progress
from reconstruction.motion_files import MOTION_ENDINGS, read_motion
from reconstruction.motion_operations import leg_length
from reconstruction.transition import (
    METHODS,
    LiveTransition,
    MotionClass,
    Transition,
    TransitionClip,
    prepared,
    ready_pair,
    transition,
)
from reconstruction.transition.measures import SeamFigures, ankle_rest, own_slide, seam_figures
from reconstruction.transition.result import seam

LABELS = {
    MotionClass.ON_THE_SPOT: r"wave|bye|byebye|bow",
    MotionClass.PLANE: r"walk|walking|run|running|dash",
    MotionClass.FLIGHT: r"jump|jumping",
}
"""Words in the data sets' file names that say which class a clip is of."""
_PERSON_LEG_M = (0.4, 1.3)
_COMMON_WINDOW_S = 1.2


@dataclass(frozen=True, slots=True)
class MethodFigures:
    """One line of the table, over all pairs and exit frames.

    acceleration_share: of the cases whose peak angular acceleration over the seam is at most 1.2 times the two clips'
    own 99th percentile (over frames, of the hardest joint); acceleration_ratio: its median; ratio_all_joints: the
    median against the 99th percentile over frames and joints together, a stricter measure. slide_ratio: mean skating
    speed of the ankles over the seam to the clips' own; slide_window: the same over the 1.2 s after the exit.
    """

    method: str
    cases: int
    time_s: float
    acceleration_share: float
    acceleration_ratio: float
    acceleration_ratio_95: float
    ratio_all_joints: float
    jerk_rad_s3: float
    slide_m_s: float
    slide_ratio: float
    slide_window: float
    penetration_mean_cm: float
    penetration_max_cm: float
    generation_ms: float
    generation_60_frames_ms: float | None


@dataclass(frozen=True, slots=True)
class TransitionReport:
    """What `evaluate_transitions` found. skipped: files left out, each with the reason."""

    clips: int
    pairs: int
    exits: int
    seed: int
    classification_agreement: float
    classified: int
    own_slide_m_s: float
    live_step_ms: float
    methods: tuple[MethodFigures, ...]
    skipped: tuple[str, ...]

    def as_dict(self) -> dict:
        return asdict(self)


def evaluate_transitions(
    data: Sequence[Path], pairs: int = 200, exits: int = 4, seed: int = 7, progress: Progress = no_progress
) -> TransitionReport:
    """Draws pairs of clips on the same joints by a fixed seed, leaves each at several frames, and measures the seams.

    data: motion files or folders of them. Raises FileError where there are no two clips on the same joints.
    """
    clips, skipped = _clips(data)
    families = _families(clips)
    rng = np.random.default_rng(seed)
    cases: dict[str, list[_Case]] = {method: [] for method in METHODS}
    own = []
    for done in range(pairs):
        family = families[done % len(families)]
        a, b = (family[i] for i in rng.choice(len(family), 2, replace=False))
        b = ready_pair(a, b)
        norms = _Norms.of(a, b)
        own.append(norms.slide)
        for at in rng.integers(2, len(a) - 1, exits):
            for method in METHODS:
                cases[method].append(_case(a, int(at), b, method, norms))
        progress(done + 1, pairs)
    agreed = [clip.motion_class is label for clip in clips if (label := labelled_class(clip.motion.name))]
    return TransitionReport(
        clips=len(clips),
        pairs=pairs,
        exits=exits,
        seed=seed,
        classification_agreement=float(np.mean(agreed)) if agreed else 1.0,
        classified=len(agreed),
        own_slide_m_s=float(np.mean(own)),
        live_step_ms=_live_step_ms(families[0][0], families[0][1]),
        methods=tuple(_summary(method, found) for method, found in cases.items()),
        skipped=tuple(skipped),
    )


def _live_step_ms(a: TransitionClip, b: TransitionClip) -> float:
    """Milliseconds: the median step of a live transition from one clip into another that plays."""
    b = ready_pair(a, b)
    shown, before = a.motion.pose(len(a) // 2), a.motion.pose(len(a) // 2 - 1)
    taken = []
    for _ in range(20):
        live = LiveTransition(shown, before, b.motion.pose(0))
        for frame in range(30):
            begin = time.perf_counter()
            live.step(1 / 60, b.motion.pose(min(frame, len(b) - 1)))
            taken.append(time.perf_counter() - begin)
    return float(np.median(taken)) * 1e3


def labelled_class(name: str) -> MotionClass | None:
    """The class that a file name's words say, None where they say none or more than one."""
    words = re.split(r"[^a-z]+", name.lower())
    found = [kind for kind, pattern in LABELS.items() if any(re.fullmatch(pattern, word) for word in words)]
    return found[0] if len(found) == 1 else None


def _clips(data: Sequence[Path]) -> tuple[list[TransitionClip], list[str]]:
    files = sorted(
        file
        for path in data
        for file in (path.rglob("*") if path.is_dir() else [path])
        if file.suffix.lower() in MOTION_ENDINGS
    )
    clips, skipped = [], []
    for file in files:
        try:
            motion = read_motion(file)
        except SixpointError as error:
            skipped.append(str(error))
            continue
        leg = leg_length(motion.skeleton)
        if not _PERSON_LEG_M[0] < leg < _PERSON_LEG_M[1]:
            skipped.append(f"{file}: legs of {leg:.2f} m, so its unit is not the centimetre")
        elif len(motion) < 8:
            skipped.append(f"{file}: only {len(motion)} frames")
        else:
            clips.append(prepared(motion))
    if len(clips) < 2:
        raise FileError(f"{', '.join(map(str, data))}: {len(clips)} usable motions; two are needed at least")
    return clips, skipped


def _families(clips: list[TransitionClip]) -> list[list[TransitionClip]]:
    """The clips by their joints' names; families of one are left out. Raises FileError where none is left."""
    families: dict[tuple[str, ...], list[TransitionClip]] = {}
    for clip in clips:
        families.setdefault(clip.skeleton.names, []).append(clip)
    several = [family for family in families.values() if len(family) > 1]
    if not several:
        raise FileError("no two of the motions have the same joints")
    # Small families would come up as often as large ones: those under a tenth of the largest are left out.
    largest = max(map(len, several))
    return [family for family in several if len(family) * 10 >= largest]


@dataclass(frozen=True, slots=True)
class _Norms:
    """What the two clips do by themselves."""

    hardest: float
    all_joints: float
    slide: float
    ankle_rest: float

    @classmethod
    def of(cls, a: TransitionClip, b: TransitionClip) -> "_Norms":
        own = np.concatenate([a.acceleration_sizes, b.acceleration_sizes])
        slide = (own_slide(a) * len(a) + own_slide(b) * len(b)) / (len(a) + len(b))
        hardest, everywhere = np.percentile(own.max(axis=1), 99), np.percentile(own, 99)
        return cls(float(hardest), float(everywhere), slide, min(ankle_rest(a), ankle_rest(b)))


@dataclass(frozen=True, slots=True)
class _Case:
    found: SeamFigures
    window_slide: float
    norms: _Norms
    time_s: float
    frames: int
    seconds: float


def _case(a: TransitionClip, at: int, b: TransitionClip, method: str, norms: _Norms) -> _Case:
    begin = time.perf_counter()
    step = transition(a, at, b, 0, method)
    seconds = time.perf_counter() - begin
    floor = min(a.floor_m, b.floor_m + float(step.placement.shift[1]))
    window = round(_COMMON_WINDOW_S * a.fps)
    shown = seam(a, at, step, b, 0, max(4, window))
    left = min(at, max(4, window))
    entered = min(left + len(step.between) + 1, len(shown) - 1)
    figures = seam_figures(shown, left, entered, floor, norms.ankle_rest)
    wide = seam_figures(shown, left, min(left + window, len(shown) - 1), floor, norms.ankle_rest)
    return _Case(figures, wide.slide_m_s, norms, step.duration_s, len(step.between), seconds)


def _summary(method: str, cases: list[_Case]) -> MethodFigures:
    ratio = np.array([case.found.peak_acceleration / max(case.norms.hardest, 1e-9) for case in cases])
    strict = np.array([case.found.peak_acceleration / max(case.norms.all_joints, 1e-9) for case in cases])
    own = float(np.mean([case.norms.slide for case in cases]))
    slide = float(np.mean([case.found.slide_m_s for case in cases]))
    depth = np.array([case.found.penetration_m for case in cases]) * 100
    sixty = [case.seconds * 1e3 for case in cases if 50 <= case.frames <= 70]
    return MethodFigures(
        method=method,
        cases=len(cases),
        time_s=float(np.median([case.time_s for case in cases])),
        acceleration_share=float(np.mean(ratio <= 1.2)),
        acceleration_ratio=float(np.median(ratio)),
        acceleration_ratio_95=float(np.percentile(ratio, 95)),
        ratio_all_joints=float(np.median(strict)),
        jerk_rad_s3=float(np.median([case.found.peak_jerk for case in cases])),
        slide_m_s=slide,
        slide_ratio=slide / max(own, 1e-9),
        slide_window=float(np.mean([case.window_slide for case in cases])) / max(own, 1e-9),
        penetration_mean_cm=float(depth.mean()),
        penetration_max_cm=float(depth.max()),
        generation_ms=float(np.median([case.seconds * 1e3 for case in cases])),
        generation_60_frames_ms=float(np.median(sixty)) if sixty else None,
    )


@dataclass(frozen=True, slots=True)
class PairFigures:
    """One transition of the matrix over a folder."""

    left: str
    entered: str
    left_class: str
    entered_class: str
    at: int
    time_s: float
    peak_acceleration_rad_s2: float
    own_acceleration_rad_s2: float
    slide_m_s: float
    penetration_cm: float


def transition_matrix(
    clips: Sequence[TransitionClip], method: str = "natural", at_share: float = 0.5, progress: Progress = no_progress
) -> list[PairFigures]:
    """Every clip into every other, left at that share of its length: classes, time and seam figures.

    Raises SettingError naming the joints where skeletons differ.
    """
    rows = []
    for i, a in enumerate(clips):
        for other in clips:
            if other is not a:
                rows.append(_pair_figures(a, round(at_share * (len(a) - 1)), ready_pair(a, other), method))
            progress(len(rows), len(clips) * (len(clips) - 1))
        progress(i * (len(clips) - 1), len(clips) * (len(clips) - 1))
    return rows


def _pair_figures(a: TransitionClip, at: int, b: TransitionClip, method: str) -> PairFigures:
    norms = _Norms.of(a, b) if len(a) > 2 and len(b) > 2 else _Norms(0.0, 0.0, 0.0, ankle_rest(a))
    step: Transition = transition(a, at, b, 0, method)
    found = _case(a, at, b, method, norms).found
    return PairFigures(
        a.motion.name,
        b.motion.name,
        a.motion_class.value,
        b.motion_class.value,
        at,
        step.duration_s,
        found.peak_acceleration,
        norms.hardest,
        found.slide_m_s,
        found.penetration_m * 100,
    )
