"""What of a trimmed take counts: it holds more bytes than that, so that what counts is as it was."""

import json
from dataclasses import asdict, dataclass
from math import ceil, floor
from typing import TYPE_CHECKING

from devices.errors import FileError

if TYPE_CHECKING:
    from replay_logs.take import Take

SPAN = "span"
"""The key in a take's metadata."""
_SLACK = 1e-6
"""Share of a frame period by which a moment may lie outside: seconds are rounded."""


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of host time. origin_ns: of the whole take's first reading, from which frames are counted."""

    origin_ns: int
    from_ns: int
    to_ns: int

    @classmethod
    def of(cls, take: "Take") -> "Span | None":
        """A take's; None where all of it counts. Raises FileError where the take says something else."""
        text = take.metadata.get(SPAN)
        if text is None:
            return None
        try:
            return cls(**{name: int(value) for name, value in json.loads(text).items()})
        except (ValueError, TypeError, AttributeError):
            raise FileError(f"{take.path}: its span is not as sixpoint writes it: {text}") from None

    def to_metadata(self) -> dict[str, str]:
        """As the entry of a take's metadata."""
        return {SPAN: json.dumps(asdict(self))}

    def frames(self, fps: float) -> tuple[int, int]:
        """The numbers of the first and the last frame in it."""
        first, last = ((ns - self.origin_ns) * 1e-9 * fps for ns in (self.from_ns, self.to_ns))
        return max(0, ceil(first - _SLACK)), floor(last + _SLACK)

    @property
    def seconds(self) -> float:
        """How long it is."""
        return (self.to_ns - self.from_ns) * 1e-9

    def __contains__(self, time_ns: int) -> bool:
        return self.from_ns <= time_ns <= self.to_ns
