"""The live session: devices in, shots out, everything kept. The loop is `Session.turn`."""

import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from capture.clock import SessionClock
from capture.device_reader import Arrival, DeviceReader
from capture.latency import LatencyRecorder
from capture.pipeline import Pipeline, Shot
from capture.tuning import Tuning, Value
from devices.assembler import FrameAssembler
from devices.driver import Driver
from devices.errors import FileError
from devices.frame import TrackerFrame
from devices.intake import DeviceIntake
from replay_logs.recorder import TakeRecorder

_TURN_S = 0.02
_MOST_FRAMES_BEHIND = 6
"""A session that is later than this skips frames: it would rather be on time than complete. The take is complete."""


@dataclass(frozen=True, eq=False)
class SessionDevice:
    """An open driver, and how its trackers become roles in the room."""

    driver: Driver
    intake: DeviceIntake


class Session:
    """Reads devices, records, solves and skins until it is stopped.

    Without a pipeline it only records.

    `latest` is the newest shot, for whoever draws; `watchers` (streams) are called with each, on the session's thread.
    tuning: settings that change between two frames when asked; each change is kept in the take. tell: called with one
    line where something is lost, on the session's thread.
    """

    def __init__(
        self,
        devices: Sequence[SessionDevice],
        assembler: FrameAssembler,
        pipeline: Pipeline | None,
        clock: SessionClock,
        recorder: TakeRecorder | None = None,
        watchers: Sequence[Callable[[Shot], None]] = (),
        tuning: Tuning | None = None,
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.devices, self.assembler, self.pipeline, self.clock = tuple(devices), assembler, pipeline, clock
        self.recorder, self.watchers = recorder, tuple(watchers)
        self.tuning, self._tell = tuning or Tuning(), tell
        self.latest: Shot | None = None
        self.latencies = LatencyRecorder()
        self.solved = self.skipped = self.samples = 0
        self.first_pose_ns: int | None = None
        """Host time at which the first pose of a performer who is seen was ready."""
        self._changed: dict[str, Value] = {}
        self._asked: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._inbox: queue.SimpleQueue[Arrival] = queue.SimpleQueue()
        self.readers = tuple(DeviceReader(i, d.driver, self._inbox) for i, d in enumerate(self.devices))

    def run(self, stop: threading.Event) -> None:
        """Works until `stop` is set.

        A take that cannot be written any more (a full disk) is given up and told, and solving goes on. Raises FileError
        for it only where there is nothing to solve.
        """
        try:
            with self._reading():
                while not stop.is_set():
                    self.turn(self._arrived(_TURN_S))
            self._do_what_was_asked()
            self._keep_and_place(self._arrived(0.0))
        finally:
            self._record(None)
        self._bow_out()

    def record(self, recorder: TakeRecorder | None) -> None:
        """From the next turn on readings go to this take, or to none; the one before is finished. From any thread."""
        self._asked.put(lambda: self._record(recorder))

    def mark(self, text: str) -> None:
        """Notes this moment in the take, where there is one. From any thread."""
        now_ns = self.clock.now_ns()
        self._asked.put(lambda: self._keep(lambda recorder: recorder.mark(now_ns, text)))

    def turn(self, arrivals: Sequence[Arrival]) -> None:
        """One turn of the loop: what arrived is kept and placed, and becomes the shots that are due."""
        self._do_what_was_asked()
        due = self._keep_and_place(arrivals)
        if self.pipeline is None:
            return
        for frame, ready_ns in due:
            if (self.clock.now_ns() - ready_ns) * 1e-9 * self.assembler.rate_hz > _MOST_FRAMES_BEHIND:
                self.skipped += 1
                continue
            shot = self.pipeline.step(frame)
            self.latest, self.solved = shot, self.solved + 1
            self._time(shot, ready_ns)
            for watch in self.watchers:
                watch(shot)

    def _bow_out(self) -> None:
        """The last pose goes over into idling, for whoever watches: nobody is left frozen in mid-stride."""
        if self.pipeline is None or self.latest is None or not self.watchers:
            return
        for shot in self.pipeline.bow_out(self.latest, 1 / self.assembler.rate_hz):
            self.latest = shot
            for watch in self.watchers:
                watch(shot)
            time.sleep(1 / self.assembler.rate_hz)

    def _do_what_was_asked(self) -> None:
        """Between two frames: a take begins or ends, and settings change from the next reading on."""
        while not self._asked.empty():
            self._asked.get()()
        changed = self.tuning.apply()
        self._changed |= changed
        if changed:
            self._keep(lambda recorder: recorder.settings(self.clock.now_ns(), changed))

    def _record(self, recorder: TakeRecorder | None) -> None:
        self._keep(lambda before: before.close())
        self.recorder = recorder
        if self._changed:
            self._keep(lambda begun: begun.settings(self.clock.now_ns(), self._changed))

    def _keep(self, write: Callable[[TakeRecorder], None]) -> None:
        """Writes to the take, where there is one. One that fails is let go."""
        if self.recorder is None:
            return
        try:
            write(self.recorder)
        except FileError as error:
            self.recorder.close()
            self.recorder = None
            if self.pipeline is None:
                raise
            self._tell(f"{error}; the session goes on without recording")

    def _keep_and_place(self, arrivals: Sequence[Arrival]) -> list[tuple[TrackerFrame, int]]:
        """The frames that are complete or have waited long enough, each with the host time at which it was."""
        due = []
        for arrival in arrivals:
            device, reading = self.devices[arrival.device], arrival.reading
            self._keep(lambda recorder, by=device, kept=reading: recorder.write(by.driver.name, kept))
            self.assembler.push(device.intake.readings(reading.samples))
            self.samples += len(reading.samples)
            if reading.chunks:
                due += [(frame, reading.chunks[-1].host_time_ns) for frame in self.assembler.complete()]
        now_ns = self.clock.now_ns()
        self._keep(lambda recorder: recorder.keep_up(now_ns))
        return due + [(frame, self._waited_ns(frame)) for frame in self.assembler.frames(now_ns)]

    def _waited_ns(self, frame: TrackerFrame) -> int:
        """When a frame that was not complete had waited long enough."""
        return self._moment_ns(frame) + round(self.assembler.latency_s * 1e9)

    def _moment_ns(self, frame: TrackerFrame) -> int:
        return self.clock.start_ns + round(frame.time_s * 1e9)

    def _arrived(self, timeout_s: float) -> list[Arrival]:
        """All that has come; waits for the first of it until the next frame is due at the latest."""
        arrivals: list[Arrival] = []
        try:
            arrivals.append(self._inbox.get(timeout=min(timeout_s, 0.5 / self.assembler.rate_hz)))
            while True:
                arrivals.append(self._inbox.get_nowait())
        except queue.Empty:
            return arrivals

    def _time(self, shot: Shot, ready_ns: int) -> None:
        now_ns = self.clock.now_ns()
        if self.first_pose_ns is None and shot.frame.measured.any():
            self.first_pose_ns = now_ns
        self.latencies.add_all(shot.stages_ns)
        self.latencies.add("last byte to vertices", now_ns - ready_ns)
        self.latencies.add("moment to vertices", now_ns - self._moment_ns(shot.frame))

    @contextmanager
    def _reading(self) -> Iterator[None]:
        for reader in self.readers:
            reader.start()
        try:
            yield
        finally:
            for reader in self.readers:
                reader.stop()
