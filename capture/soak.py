"""A long session on a clock that runs as fast as the work is done: whether memory and latency stay flat."""

import gc
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np

from capture.clock import SessionClock
from capture.config import SessionConfig
from capture.demo_take import trackers_on
from capture.device_reader import Arrival
from capture.live import filters_of, make_pipeline, open_streams
from capture.session import Session, SessionDevice
from devices.assembler import FrameAssembler
from devices.driver import RawChunk, Reading
from devices.progress import Progress, no_progress
from devices.protocols import make_protocol
from devices.sample import ROLES
from devices.simulators.source import Faults, measurements
from reconstruction.motion_library import demo_motion
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice

PARTS = 10
_DEVICE = "generic-binary"
_FAULTS = Faults(noise_m=0.001, dropout=0.02, clock_drift=5e-5)
_RATE_HZ = 60.0


@dataclass(frozen=True, slots=True)
class SoakPart:
    """A tenth of a session. memory_mb: resident at its end. p50_ms, p99_ms, max_ms: of the time that a frame took."""

    minutes: float
    poses: int
    memory_mb: float
    p50_ms: float
    p99_ms: float
    max_ms: float


class SoakMeter:
    """Collects what frames took, and memory, by tenths of a session's length."""

    def __init__(self, seconds: float) -> None:
        self._part_s = seconds / PARTS
        self._taken_ms: list[float] = []
        self.parts: list[SoakPart] = []

    def add(self, at_s: float, milliseconds: float) -> None:
        """One more frame, at that second of the session."""
        self._taken_ms.append(milliseconds)
        if len(self.parts) < PARTS and at_s >= self._part_s * (len(self.parts) + 1):
            taken = np.array(self._taken_ms)
            p50, p99 = np.percentile(taken, (50, 99))
            figures = (float(p50), float(p99), float(taken.max()))
            self.parts.append(SoakPart(at_s / 60, len(taken), memory_mb(), *(round(f, 3) for f in figures)))
            self._taken_ms.clear()


def memory_mb() -> float:
    """What this process has in memory now, megabytes. Linux's own count; 0 where it does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return 0.0
    return round(pages * 4096 / 1e6, 1)


class _GivenClock(SessionClock):
    """A clock that says what it is told."""

    moment_ns = 0

    def now_ns(self) -> int:
        return self.moment_ns


class _NoDriver:
    """Stands for the device: its readings come without a thread."""

    name = "trackers"

    def open(self) -> None: ...

    def read(self, timeout_s: float) -> Reading:
        return Reading()

    def close(self) -> None: ...


def soak(config: SessionConfig, seconds: float, progress: Progress = no_progress) -> list[SoakPart]:
    """A session of that length, six trackers at 60 Hz with noise and dropouts, recorded, streamed and skinned.

    Its frames are timed in processor time: what else the machine does must not look like a session that slows down.
    """
    meter = SoakMeter(seconds)
    with _session(config) as (session, clock):
        total = round(seconds * _RATE_HZ)
        for number, (time_s, reading) in enumerate(_readings(seconds)):
            clock.moment_ns = reading.chunks[-1].host_time_ns
            begin = time.thread_time_ns()
            session.turn([Arrival(0, reading)])
            meter.add(time_s, (time.thread_time_ns() - begin) * 1e-6)
            progress(number, total)
    return meter.parts


def _readings(seconds: float) -> Iterator[tuple[float, Reading]]:
    """What a device says in that time, through its bytes."""
    source, parser = make_protocol(_DEVICE), make_protocol(_DEVICE)
    simulated = source.simulator(ROLES)
    told = measurements(trackers_on(demo_motion()), _RATE_HZ, _FAULTS, loop=True)
    for time_s, samples in takewhile(lambda at: at[0] <= seconds + 1 / _RATE_HZ, told):
        now_ns = round(time_s * 1e9)
        data = b"".join(simulated.measure(samples))
        yield time_s, Reading((RawChunk(now_ns, data),), tuple(parser.feed(data, now_ns)))


@contextmanager
def _session(config: SessionConfig) -> Iterator[tuple[Session, _GivenClock]]:
    pipeline, clock = make_pipeline(config), _GivenClock(0)
    pipeline.warm_up()
    gate, smoothing = filters_of(config.device[0], filters_itself=False)
    numbers = {str(number): role for number, role in enumerate(ROLES, 1)}
    recorded = RecordedDevice(_NoDriver.name, _DEVICE, {}, numbers, gate=gate, smoothing=smoothing)
    assembler = FrameAssembler(_RATE_HZ, config.solver.latency_ms / 1000, epoch_ns=0)
    with (
        tempfile.TemporaryDirectory() as folder,
        open_streams(config, pipeline) as watchers,
        TakeRecorder(Path(folder) / "soak.mcap") as recorder,
    ):
        recorder.add_device(recorded)
        device = SessionDevice(_NoDriver(), recorded.intake())
        gc.collect()
        yield Session([device], assembler, pipeline, clock, recorder, watchers), clock


def figures(parts: list[SoakPart]) -> dict[str, object]:
    """All of it, and what changed from the second tenth, when all is warm, to the last."""
    first, last = parts[1], parts[-1]
    return {
        "parts": [asdict(part) for part in parts],
        "memory_grown_mb": round(last.memory_mb - first.memory_mb, 1),
        "p50_ratio": round(last.p50_ms / first.p50_ms, 3),
        "p99_ratio": round(last.p99_ms / first.p99_ms, 3),
    }


def table(parts: list[SoakPart]) -> object:
    """A rich table of the tenths."""
    from rich.table import Table

    made = Table(title="by tenths of the session", title_justify="left")
    columns: dict[str, Callable[[SoakPart], str]] = {
        "minutes": lambda part: f"{part.minutes:.1f}",
        "frames": lambda part: str(part.poses),
        "memory MB": lambda part: f"{part.memory_mb:.1f}",
        "p50 ms": lambda part: f"{part.p50_ms:.2f}",
        "p99 ms": lambda part: f"{part.p99_ms:.2f}",
        "max ms": lambda part: f"{part.max_ms:.2f}",
    }
    for name in columns:
        made.add_column(name, justify="right")
    for part in parts:
        made.add_row(*(shown(part) for shown in columns.values()))
    return made
