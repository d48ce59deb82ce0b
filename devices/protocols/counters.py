"""Running numbers that wrap: device clocks and sequence numbers."""

from dataclasses import dataclass


@dataclass(slots=True)
class Unwrapped:
    """Makes a counter that wraps at `modulus` run on for ever; small steps back are kept as such."""

    modulus: int
    value: int | None = None

    def __call__(self, raw: int) -> int:
        """The running value of a raw reading, the nearest to the last one."""
        if self.value is None:
            self.value = raw
        else:
            half = self.modulus // 2
            self.value += (raw - self.value + half) % self.modulus - half
        return self.value


@dataclass(slots=True)
class SequenceGaps:
    """Counts what is missing between one tracker's running numbers."""

    modulus: int
    last: int | None = None

    def __call__(self, raw: int) -> int:
        """How many numbers were left out since the last; 0 after a repeat, a step back or a restart."""
        step = 1 if self.last is None else (raw - self.last) % self.modulus
        self.last = raw
        return step - 1 if 1 <= step <= self.modulus // 2 else 0
