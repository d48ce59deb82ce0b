"""The driver contract: how the session, the recorder and the doctor see any device, a replayed take included."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from devices.sample import TrackerSample


@dataclass(frozen=True, slots=True)
class RawChunk:
    """Bytes as they came off the wire. host_time_ns: `time.perf_counter_ns` after the last of them arrived."""

    host_time_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Reading:
    """What one `read` brought: the raw bytes, and the samples that these bytes completed."""

    chunks: tuple[RawChunk, ...] = ()
    samples: tuple[TrackerSample, ...] = ()


@runtime_checkable
class Driver(Protocol):
    """A device that gives tracker samples.

    `read` blocks for at most `timeout_s` and returns what has come since, possibly nothing. It raises `DeviceLost` once
    when the device is gone; `open` may then be called again.
    """

    name: str

    def open(self) -> None: ...

    def read(self, timeout_s: float) -> Reading: ...

    def close(self) -> None: ...
