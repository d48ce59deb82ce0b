"""Parts of start-up scripts that several serial devices share."""

from collections.abc import Callable, Generator, Sequence

from devices.errors import DeviceError
from devices.protocols.protocol import SetBaud, Step

Question = Generator[Step, bytes, bool]
"""A script that returns whether the device answered as it should."""

COMMON_BAUDS = (115200, 19200, 9600, 38400, 57600)


def find_baud(
    bauds: Sequence[int], question: Callable[[], Question], device: str, hint: str
) -> Generator[Step, bytes, int]:
    """Tries line speeds until the question is answered, and returns that speed.

    Raises DeviceError naming the device, the speeds and the hint where none is.
    """
    for baud in bauds:
        yield SetBaud(baud)
        if (yield from question()):
            return baud
    speeds = ", ".join(map(str, bauds))
    raise DeviceError(f"no answer from {device} at {speeds} baud: {hint}")


class CommandLine:
    """Cuts what a host writes into commands: some letters take effect at once, the others end in CR.

    immediate: the letters (or control characters) that are whole commands.
    """

    def __init__(self, immediate: str = "") -> None:
        self._immediate = immediate
        self._typed = ""

    def commands(self, data: bytes) -> list[str]:
        """The commands that these bytes complete, without their CR; a lone CR ends a half-typed one silently."""
        whole = []
        for char in data.decode("latin-1"):
            if not self._typed and char in self._immediate:
                whole.append(char)
            elif char == "\r":
                if self._typed:
                    whole.append(self._typed)
                self._typed = ""
            elif char != "\n":
                self._typed += char
        return whole
