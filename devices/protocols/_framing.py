"""Finding frames in a byte stream, and getting in step again after garbage."""

from abc import abstractmethod
from dataclasses import dataclass, field

from devices.protocols.protocol import DeviceProtocol
from devices.sample import TrackerSample

Scan = tuple[int, list[TrackerSample] | None]
"""(bytes used, samples), or (bytes used, None) where these bytes belong to no good frame, or `WAIT`."""

WAIT: Scan = (0, None)
DROP_ONE: Scan = (1, None)


@dataclass
class FramedProtocol(DeviceProtocol):
    """A serial protocol whose stream is a row of frames.

    What `scan` says may depend on the bytes from `start` on only, never on how they were split, so that any split of
    the stream gives the same samples. After a bad frame it drops one byte, not the frame: the next good frame may
    begin inside.
    """

    found_baud: int = field(default=0, init=False, repr=False, compare=False)
    """The line speed at which start-up found the device, 0 where it is the one the port was opened with."""
    _rest: bytes = field(default=b"", init=False, repr=False, compare=False)

    @abstractmethod
    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        """What begins at `start` (there is at least one byte): a whole frame, nothing of ours, or `WAIT` for more.

        It may wait for no more bytes than the longest frame has.
        """

    def feed(self, data: bytes, host_time_ns: int) -> list[TrackerSample]:
        buffer = self._rest + data
        start = 0
        found: list[TrackerSample] = []
        while start < len(buffer):
            used, samples = self.scan(buffer, start, host_time_ns)
            if not used:
                break
            if samples is None:
                self.counters.bytes_dropped += used
            else:
                found += samples
            start += used
        self._rest = buffer[start:]
        return found

    def reset(self) -> None:
        super().reset()
        self._rest = b""


def drop_until(buffer: bytes, start: int, mark: bytes) -> Scan:
    """Drops at least one byte, up to where `mark` or a first part of it may begin."""
    found = buffer.find(mark, start + 1)
    if found < 0:
        found = next((len(buffer) - n for n in range(len(mark) - 1, 0, -1) if buffer.endswith(mark[:n])), len(buffer))
    return max(found - start, 1), None
