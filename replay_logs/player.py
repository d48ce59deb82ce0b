"""A take that plays back as a device: the same bytes through the same parser."""

import time

from devices.driver import RawChunk, Reading
from replay_logs.take import RecordedDevice, Take


class TakePlayer:
    """`Driver` over one device of a take.

    speed: 1 is as it was recorded, 2 twice as fast; None is as fast as it is read. With a speed, host times are moved
    to now as the session's clock needs it (and squeezed accordingly); with None they are the recorded ones, and so are
    the samples. start_ns: host time of the take at which playing begins, by default its first chunk; give all devices
    of a take the same to keep them together.
    """

    def __init__(
        self, take: Take, device: RecordedDevice, speed: float | None = 1.0, start_ns: int | None = None
    ) -> None:
        self.name = device.name
        self.role_hints = device.assignment
        self._device = device
        self._chunks = take.chunks[device.name]
        self._speed = speed
        self._start_ns = self._chunks[0].host_time_ns if start_ns is None and self._chunks else start_ns or 0
        self.open()

    def open(self) -> None:
        """Rewinds to the beginning."""
        self._protocol = self._device.make_protocol()
        self._next = 0
        self._opened_ns = time.perf_counter_ns()

    @property
    def finished(self) -> bool:
        """Whether all has been read."""
        return self._next >= len(self._chunks)

    def read(self, timeout_s: float) -> Reading:
        """The next chunk where its time has come, or nothing after `timeout_s`, or at once when all has been read."""
        if self.finished:
            return Reading()
        chunk = self._chunks[self._next]
        if self._speed is not None:
            chunk = RawChunk(self._now_time(chunk.host_time_ns), chunk.data)
            wait_s = (chunk.host_time_ns - time.perf_counter_ns()) * 1e-9
            time.sleep(min(max(wait_s, 0.0), timeout_s))
            if wait_s > timeout_s:
                return Reading()
        self._next += 1
        if not chunk.data:
            self._protocol.reset()
            return Reading((chunk,))
        return Reading((chunk,), tuple(self._protocol.feed(chunk.data, chunk.host_time_ns)))

    def close(self) -> None:
        """Nothing to let go of."""

    def _now_time(self, recorded_ns: int) -> int:
        return self._opened_ns + round((recorded_ns - self._start_ns) / (self._speed or 1.0))


def players(take: Take, speed: float | None = 1.0) -> list[TakePlayer]:
    """A player for every device of a take, together in time."""
    first = min((chunks[0].host_time_ns for chunks in take.chunks.values() if chunks), default=0)
    return [TakePlayer(take, device, speed, first) for device in take.devices]
